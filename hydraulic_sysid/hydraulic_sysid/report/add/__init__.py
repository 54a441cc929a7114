"""An effect that was added: shown as a diagnosis."""

SCHEMA = "hydraulic_sysid.add/2"
