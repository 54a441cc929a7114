"""A designed excitation."""

SCHEMA = "hydraulic_sysid.design/1"
