"""The error of frequency responses."""

from __future__ import annotations

from hydraulic_interfaces.errors import HydraulicError


class FrequencyResponseError(HydraulicError, ValueError):
    """The record cannot give the frequency response that was asked for; the message says what it lacks."""
