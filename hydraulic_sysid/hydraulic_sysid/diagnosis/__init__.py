"""The physical model against measurements: calibrate, compare, locate, search for what is missing, next experiment."""
