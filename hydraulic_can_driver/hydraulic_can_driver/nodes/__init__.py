"""Executables of the CAN driver."""
