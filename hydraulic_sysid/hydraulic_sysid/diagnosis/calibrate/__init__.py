"""Calibrate the free parameters of a model on records, before anything is called missing.

The fit itself is in `hydraulic_sysid.estimation`; `document` runs it and gathers the figures.
"""

from hydraulic_sysid.estimation.errors import CalibrationError
from hydraulic_sysid.estimation.fit import FitSettings

from .document import calibrate

__all__ = ["CalibrationError", "FitSettings", "calibrate"]
