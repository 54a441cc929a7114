"""Executables of the simulation."""
