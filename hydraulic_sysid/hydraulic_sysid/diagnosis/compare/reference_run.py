"""A model run beside one record, and beside its reference run: what the record would be if the model were exact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.records import Record

from .channels import Measured, measured
from .prediction import Predictions, predict
from .subject import Subject

MODES = ("free_run", "horizon", "one_step")


@dataclass(frozen=True)
class Compared:
    """One record with the model's predictions, and the same of its reference run.

    The *reference run* is the record that would have been measured if the model's free run were the truth and this
    record's noise lay on it. What the same model, started from its noisy samples, misses of it is the error that an
    exact model shows: the noise that belongs to each figure, for it holds the noise of the measurement it is compared
    with *and* of the measurement it started from.
    """

    data: Measured
    runs: Predictions
    reference: Measured
    reference_runs: Predictions

    def error(self, mode: str, channel: str) -> Array:
        """Measured − predicted, ``(N,)``, NaN where the mode has no value."""
        return self.data.channels[channel] - getattr(self.runs, mode)[channel]

    def exact_error(self, mode: str, channel: str) -> Array:
        """The same for the reference run: what an exact model would show."""
        return self.reference.channels[channel] - getattr(self.reference_runs, mode)[channel]


def run(subject: Subject, record: Record, horizon: float, seed: int = 0) -> Compared:
    """Predictions of a record and of its reference run (its noise drawn with ``seed``)."""
    record = subject.seen(record)
    data = measured(record, subject.scales)
    ready = subject.runs(data)
    runs = predict(subject, ready, data, horizon)
    rng = np.random.default_rng(seed)
    channels = {"drive": record["drive"]}
    for name in ("position", "pressure_a", "pressure_b", "pressure_supply", "spool"):
        if name in record:
            channels[name] = runs.free_run[name] + data.noise[name] * rng.standard_normal(len(record))
    if "spool" in record:
        channels["spool"] = channels["spool"] * subject.scales.spool_travel
    made = measured(replace(record, channels=channels), subject.scales, data.velocity_filter)
    reference = replace(made, noise=data.noise)
    return Compared(data, runs, reference, predict(subject, ready, reference, horizon))
