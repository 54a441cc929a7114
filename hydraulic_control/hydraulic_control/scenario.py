"""The plants on which gains are tuned and judged: the model, scattered copies of it, identified models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_control.identified import IdentifiedModel
from hydraulic_control.simulation import LoopPlant, SensorNoise, SimulatedPlant
from hydraulic_sim.batch import scatter
from hydraulic_sim.model import Model

SCATTER = {
    "moving_mass": 0.10,
    "bulk_modulus": 0.15,
    "supply_pressure": 0.05,
    "valve_flow": 0.10,
    "coulomb_friction.level": 0.40,
    "viscous_friction.coefficient": 0.30,
    "internal_leakage.coefficient": 0.30,
    "spool_dynamics.frequency": 0.15,
}
"""Standard deviations, relative to the model's values; what a model does not have is left out."""
LATE_S = 0.01
BIAS = 0.005
"""Standard deviation of the valve's null bias, of the rated drive."""


@dataclass(frozen=True)
class Case:
    """A plant to try gains on: its name, the plant at rest, and whether it is an identified model."""

    name: str
    plant: LoopPlant
    identified: bool = False


def nominal(model: Model, noise: SensorNoise) -> Case:
    """The model as it is."""
    return Case(model.name, SimulatedPlant(model, noise))


def late(model: Model, noise: SensorNoise) -> Case:
    """The model with a command that comes `LATE_S` late: what is tuned must bear that."""
    return Case("late", SimulatedPlant(model.with_effect("command_delay", {"delay": LATE_S}), noise))


def scattered_models(model: Model, count: int, seed: int) -> list[Model]:
    """``count`` copies with scattered parameters, and with a valve that is not quite in the middle."""
    known = set(model.keys())
    copies = scatter(model, {key: s for key, s in SCATTER.items() if key in known}, count, seed)
    offsets = np.random.default_rng(seed + 1).normal(0.0, BIAS, count)
    if model.kind == "hydraulic":
        copies = [m.with_effect("valve_null_bias", {"bias": float(b)}) for m, b in zip(copies, offsets, strict=True)]
    return copies


def scattered(model: Model, count: int, seed: int, noise: SensorNoise) -> list[Case]:
    """`scattered_models` at rest behind their sensors."""
    copies = scattered_models(model, count, seed)
    return [Case(f"scattered {i + 1}", SimulatedPlant(m, noise, seed + i)) for i, m in enumerate(copies)]


def identified(models: Sequence[IdentifiedModel]) -> list[Case]:
    """The identified models."""
    return [Case(f"identified {m.name}", m, True) for m in models]
