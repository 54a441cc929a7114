"""The error of this package."""

from __future__ import annotations

from hydraulic_sysid.errors import HydraulicSysidError


class GreyBoxError(HydraulicSysidError, ValueError):
    """Records, or the way they are held out, do not allow a black box on top of the white one."""
