"""Command line verbs of the CAN driver: one file, one verb."""
