"""What can be wrong with a question for the next experiment."""

from hydraulic_interfaces.errors import HydraulicError


class NextExperimentError(HydraulicError):
    """The models cannot be compared, or no movement keeps the limits; the message says why."""
