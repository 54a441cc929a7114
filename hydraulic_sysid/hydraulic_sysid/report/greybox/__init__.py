"""A grey box: a black box on top of a physical model."""

SCHEMA = "hydraulic_sysid.greybox/2"
