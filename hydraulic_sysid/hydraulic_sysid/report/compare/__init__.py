"""A model against measurements."""

SCHEMA = "hydraulic_sysid.compare/2"
