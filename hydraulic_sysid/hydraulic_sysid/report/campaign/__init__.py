"""Campaign: many cases of one verb."""

SCHEMA = "hydraulic_sysid.campaign/1"
