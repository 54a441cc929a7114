"""A model file against records, before anything is fitted."""

SCHEMA = "hydraulic_sysid.check/1"
