"""The error of frequency responses."""

from __future__ import annotations

from hydraulic_sysid.errors import HydraulicSysidError


class FrequencyResponseError(HydraulicSysidError, ValueError):
    """The record cannot give the frequency response that was asked for; the message says what it lacks."""
