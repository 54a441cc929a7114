"""The error of every fit of this package."""

from __future__ import annotations

from hydraulic_interfaces.errors import HydraulicError


class IdentificationError(HydraulicError, ValueError):
    """The data cannot give the model that was asked for (too short, input not moving, wrong order)."""
