"""Calibrate the free parameters of a model on records, before anything is called missing.

`segments` cuts records into short pieces, `shooting` runs a plant over all of them, `estimate` fits parameters (by
`steps`) and every piece's initial state, `statistics` says how well the data tell them, `document` gathers the figures.
"""

from .document import calibrate
from .estimate import CalibrationError, Settings

__all__ = ["CalibrationError", "Settings", "calibrate"]
