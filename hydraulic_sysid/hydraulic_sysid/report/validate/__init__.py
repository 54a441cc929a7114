"""Identified models on what they were not fitted to."""

SCHEMA = "hydraulic_sysid.validate/2"
