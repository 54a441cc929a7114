"""Where a model fails."""

SCHEMA = "hydraulic_sysid.locate/2"
