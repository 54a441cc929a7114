"""The study of Nisar & Munawar, reproduced."""

SCHEMA = "hydraulic_sysid.paper/2"
