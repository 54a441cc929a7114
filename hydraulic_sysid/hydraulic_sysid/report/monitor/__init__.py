"""One actuator over many bags."""

SCHEMA = "hydraulic_sysid.monitor/1"
