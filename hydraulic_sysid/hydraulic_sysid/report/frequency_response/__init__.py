"""A frequency response."""

SCHEMA = "hydraulic_sysid.frequency_response/2"
