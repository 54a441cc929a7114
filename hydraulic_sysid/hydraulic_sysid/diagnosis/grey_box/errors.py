"""The error of this package."""

from __future__ import annotations

from hydraulic_interfaces.errors import HydraulicError


class GreyBoxError(HydraulicError, ValueError):
    """Records, or the way they are held out, do not allow a black box on top of the white one."""
