"""A model run beside one record, and beside what the record would be if the model were exact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model_file import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record

from .channels import Measured, measured
from .prediction import Predictions, inner_states, predict

MODES = ("free_run", "horizon", "one_step")


@dataclass(frozen=True)
class Compared:
    """One record with the model's predictions, and the same of its twin.

    The *twin* is the record that would have been measured if the model's free run were the truth and this
    record's noise lay on it. What the same model, started from the twin's noisy samples, misses of it is the
    error that an exact model shows: the floor that belongs to each figure, for it holds the noise of the
    measurement it is compared with *and* of the measurement it started from.
    """

    data: Measured
    runs: Predictions
    twin: Measured
    twin_runs: Predictions

    def error(self, mode: str, channel: str) -> Array:
        """Measured − predicted, ``(N,)``, NaN where the mode has no value."""
        return self.data.channels[channel] - getattr(self.runs, mode)[channel]

    def exact_error(self, mode: str, channel: str) -> Array:
        """The same for the twin: what an exact model would show."""
        return self.twin.channels[channel] - getattr(self.twin_runs, mode)[channel]


def run(model: Model, plant: Plant, record: Record, horizon: float, seed: int = 0) -> Compared:
    """Predictions of a record and of its twin (its noise drawn with ``seed``)."""
    data = measured(record, model)
    inner = inner_states(plant, data)
    runs = predict(model, plant, data, horizon, inner)
    rng = np.random.default_rng(seed)
    channels = {"drive": record["drive"]}
    for name in ("position", "pressure_a", "pressure_b", "pressure_supply", "spool"):
        if name in record:
            channels[name] = runs.free_run[name] + data.noise[name] * rng.standard_normal(len(record))
    if "spool" in record:
        channels["spool"] = channels["spool"] * model.value("spool_travel")
    twin = replace(measured(replace(record, channels=channels), model, data.velocity_filter), noise=data.noise)
    return Compared(data, runs, twin, predict(model, plant, twin, horizon, inner))
