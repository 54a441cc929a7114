"""What can be wrong with a question for the next experiment."""

from hydraulic_sysid.errors import HydraulicSysidError


class NextExperimentError(HydraulicSysidError):
    """The rivals cannot be compared, or no movement keeps the limits; the message says why."""
