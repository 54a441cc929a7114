"""Three ways to run a model beside a record: free run, a finite horizon ahead, one step ahead.

- *Free run*: from the first sample on, the drive alone. An integrating plant keeps every small error of flow,
  so the position drifts however good the model is elsewhere.
- *Horizon*: started afresh from the measurement every tenth of the horizon, each start run for one horizon.
  What is set against the measurement is the last tenth of each run; side by side these tile the record.
- *One step*: started from the measurement at every sample, one sample ahead.

A start takes position and pressures as measured (one step) or smoothed over a few samples (free run,
horizon), the velocity from the derivative filter, and everything that is not measured from the model:
pressures that the record lacks, and inner states of effects, as they are in the free run at that instant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array, Index
from hydraulic_sysid.data.records import Record

from .channels import Measured, Scales
from .subject import Runs, Subject

TILES = 10
"""Starts per horizon."""


class ComparisonError(HydraulicError, ValueError):
    """A record or a setting does not allow the comparison (channel missing, record too short)."""


@dataclass(frozen=True)
class Predictions:
    """Predicted channels of one record, each ``(N,)``, NaN where a mode has no value (at its beginning)."""

    free_run: dict[str, Array]
    horizon: dict[str, Array]
    one_step: dict[str, Array]
    growth_lead: Array
    """``(L,)`` seconds ahead."""
    growth_rms: dict[str, Array]
    """``(L,)`` RMS error over all starts of the horizon, that far ahead."""


def check(record: Record, horizon: float) -> None:
    """Whether a record can be compared at all.

    :raises ComparisonError: naming the record and what it lacks.
    """
    record.require("drive", "position", error=ComparisonError)
    if horizon < 10.0 * record.dt:
        raise ComparisonError(f"{record.name}: horizon {horizon:g} s is shorter than ten samples of {record.dt:g} s")
    if record.duration < 2.0 * horizon:
        raise ComparisonError(
            f"{record.name}: {record.duration:g} s long, but a horizon of {horizon:g} s needs twice "
            "that: choose a shorter horizon"
        )


def predict(subject: Subject, runs: Runs, data: Measured, horizon: float) -> Predictions:
    """Run a subject beside a record in all three ways; ``runs`` are those that it made ready for this record."""
    record = data.record
    dt, count = record.dt, len(record)
    ahead = int(round(horizon / dt))
    stride = max(1, ahead // TILES)
    free = runs.free(data)
    # Each run goes on for half the derivative filter: its velocity is filtered as the measured one is.
    beyond = ahead + data.velocity_filter.half
    starts = np.arange(0, count - beyond, stride)
    found = runs.ahead(data, starts, beyond, smoothed=True)
    leads = {name: values[:, : ahead + 1] for name, values in found.items()}
    leads["velocity"] = data.velocity_filter(found["position"])[:, : ahead + 1]
    step = runs.ahead(data, np.arange(count - 1), 1, smoothed=False)
    free["velocity"] = data.velocity_filter(free["position"])
    ahead_channels = _compared(subject.scales, data, leads)
    lead_index = np.unique(np.round(np.geomspace(1, ahead, 24)).astype(np.int64))
    growth = {
        name: np.sqrt(np.mean((data.channels[name][starts[:, None] + lead_index] - values[:, lead_index]) ** 2, axis=0))
        for name, values in ahead_channels.items()
        if name in data.compared
    }
    return Predictions(
        free_run=_compared(subject.scales, data, free),
        horizon={name: _tile(values, starts, ahead, stride, count) for name, values in ahead_channels.items()},
        one_step=_compared(subject.scales, data, {n: np.concatenate(([np.nan], v[:, 1])) for n, v in step.items()}),
        growth_lead=dt * lead_index.astype(float),
        growth_rms=growth,
    )


def _tile(values: Array, starts: Index, ahead: int, stride: int, count: int) -> Array:
    """The last ``stride`` samples of every run, side by side: ``(count,)``, NaN before the first."""
    tiled = np.full(count, np.nan)
    index = starts[:, None] + np.arange(ahead - stride + 1, ahead + 1)
    tiled[index] = values[:, ahead - stride + 1 :]
    return tiled


def _compared(scales: Scales, data: Measured, channels: dict[str, Array]) -> dict[str, Array]:
    """What the record can be compared with, the load pressure among it."""
    channels = scales.with_load_pressure(channels)
    return {name: channels[name] for name in data.compared}
