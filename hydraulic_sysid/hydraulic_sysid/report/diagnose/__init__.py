"""A diagnosis."""

SCHEMA = "hydraulic_sysid.diagnose/2"
