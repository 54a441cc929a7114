"""An experiment rehearsed on a model."""

SCHEMA = "hydraulic_sysid.rehearse/1"
