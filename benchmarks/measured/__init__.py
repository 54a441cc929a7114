"""Studies on measured data of real machines, one module a data set; run by `benchmarks/measured_studies.py`."""
