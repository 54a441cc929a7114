"""A calibration."""

SCHEMA = "hydraulic_sysid.calibrate/2"
