"""A bandwidth."""

SCHEMA = "hydraulic_sysid.bandwidth/2"
