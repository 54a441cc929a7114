"""An identified linear model."""

SCHEMA = "hydraulic_sysid.identify/3"
