"""The error of this package."""

from hydraulic_interfaces.errors import HydraulicError


class ControlError(HydraulicError, ValueError):
    """Gains, trajectories, identified models or responses are not acceptable; the message says where and why."""
