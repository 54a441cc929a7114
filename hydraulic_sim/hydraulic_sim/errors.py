"""The errors this package raises; each message says what, where, the value and what is allowed."""

from __future__ import annotations


class HydraulicSimError(Exception):
    """Base of every error of this package."""


class EffectError(HydraulicSimError, ValueError):
    """An effect file is incomplete or contradicts itself or the composition it joins."""


class ModelError(HydraulicSimError, ValueError):
    """A model file, or a value put into a model, is not acceptable."""


class SimulationError(HydraulicSimError, RuntimeError):
    """A simulation left the numbers: NaN or infinity, or a step that cannot follow the physics."""
