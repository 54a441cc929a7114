"""Many actuators beside each other."""

SCHEMA = "hydraulic_sysid.fleet/1"
