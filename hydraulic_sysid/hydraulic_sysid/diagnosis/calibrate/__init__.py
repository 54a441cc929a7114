"""Calibrate the free parameters of a model on records, before anything is called missing.

`segments` cuts records into short pieces, `shooting` runs a plant over all of them, `estimate` fits parameters (by
`steps`) and every piece's initial state, `statistics` says how well the data tell them, `document` gathers the figures.
"""

from hydraulic_sysid.estimation.estimate import CalibrationError, Settings

from .document import calibrate

__all__ = ["CalibrationError", "Settings", "calibrate"]
