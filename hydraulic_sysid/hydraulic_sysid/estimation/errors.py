"""What can be wrong with records or a model that are to be fitted."""

from hydraulic_interfaces.errors import HydraulicError


class CalibrationError(HydraulicError, ValueError):
    """There is nothing to fit, or the data do not allow it; the message says what is needed."""


class SegmentError(CalibrationError):
    """A record cannot be cut into segments (too short, no drive or position)."""
