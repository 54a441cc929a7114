"""Excitation, records, identification, comparison and diagnosis of a hydraulic actuator, with their nodes."""
