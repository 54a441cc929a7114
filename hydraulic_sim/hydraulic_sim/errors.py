"""The errors this package raises; each message says what, where, the value and what is allowed."""

from hydraulic_interfaces.errors import HydraulicError


class EffectError(HydraulicError, ValueError):
    """An effect file is incomplete or contradicts itself or the composition it joins."""


class ModelError(HydraulicError, ValueError):
    """A model file, or a value put into a model, is not acceptable."""


class SimulationError(HydraulicError, RuntimeError):
    """A simulation left the numbers: NaN or infinity, or a step that cannot follow the physics."""


class ExchangeError(HydraulicError, ValueError):
    """A model cannot be written in another form, or one of another form cannot be run."""
