"""A designed next experiment."""

SCHEMA = "hydraulic_sysid.next_experiment/2"
