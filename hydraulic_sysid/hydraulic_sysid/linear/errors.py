"""What records cannot give."""

from hydraulic_interfaces.errors import HydraulicError


class IdentificationError(HydraulicError, ValueError):
    """The data cannot give the model that was asked for (too short, input not moving, wrong order)."""


class FrequencyResponseError(HydraulicError, ValueError):
    """The record cannot give the frequency response that was asked for; the message says what it lacks."""


class BandwidthError(HydraulicError, ValueError):
    """The response does not reach where the bandwidth is; the message says which end is missing."""
