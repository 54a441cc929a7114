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
from scipy.signal import savgol_filter

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model_file import Model
from hydraulic_sim.plant import Plant, PlantState
from hydraulic_sysid.data.records import Record

from .channels import Measured, load_pressure

TILES = 10
"""Starts per horizon."""
_SMOOTHING = 7  # samples; a quadratic over them keeps motion to a quarter of the sampling frequency
_SENSED = ("position", "velocity", "pressure_a", "pressure_b", "pressure_supply", "spool")


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


def start(plant: Plant, data: Measured) -> PlantState:
    """The state at a record's first sample: measured where there is a measurement, at rest elsewhere."""
    first = {name: float(values[0]) for name, values in _start_values(data, smoothed=True).items()}
    return plant.initial_state(**first, drive=float(data.record["drive"][0]))


def inner_states(plant: Plant, data: Measured) -> Array:
    """All states of the free run ``(N, n_states)``, each at its sample."""
    live = LivePlant(plant, start(plant, data))
    dt = data.record.dt
    states = np.empty((len(data.record), len(plant.state_names)))
    for k, volts in enumerate(data.record["drive"].tolist()):
        states[k] = live.state.states
        live.step(volts, dt)
    return states


def predict(model: Model, plant: Plant, data: Measured, horizon: float, inner: Array) -> Predictions:
    """Run the plant beside a record in all three ways; ``inner`` are the states of its free run."""
    record = data.record
    drive = record["drive"]
    dt, count = record.dt, len(record)
    ahead = int(round(horizon / dt))
    stride = max(1, ahead // TILES)
    smooth = _start_values(data, smoothed=True)
    run = plant.simulate(drive, dt, start(plant, data))
    free = {name: run[name] for name in _SENSED}
    # Each run goes on for half the derivative filter: its velocity is filtered as the measured one is.
    beyond = ahead + data.velocity_filter.half
    starts = np.arange(0, count - beyond, stride)
    runs = plant.predict(drive, dt, starts, beyond, _states(plant, smooth, inner, starts))
    leads = {name: runs[name][:, : ahead + 1] for name in _SENSED}
    leads["velocity"] = data.velocity_filter(runs["position"])[:, : ahead + 1]
    every = np.arange(count - 1)
    raw = _start_values(data, smoothed=False)
    step = plant.predict(drive, dt, every, 1, _states(plant, raw, inner, every))
    free["velocity"] = data.velocity_filter(free["position"])
    ahead_channels = _compared(model, data, leads)
    lead_index = np.unique(np.round(np.geomspace(1, ahead, 24)).astype(np.int64))
    growth = {
        name: np.sqrt(np.mean((data.channels[name][starts[:, None] + lead_index] - values[:, lead_index]) ** 2, axis=0))
        for name, values in ahead_channels.items()
        if name in data.compared
    }
    return Predictions(
        free_run=_compared(model, data, free),
        horizon={name: _tile(values, starts, ahead, stride, count) for name, values in ahead_channels.items()},
        one_step=_compared(model, data, {n: np.concatenate(([np.nan], step[n][:, 1])) for n in _SENSED}),
        growth_lead=dt * lead_index.astype(float),
        growth_rms=growth,
    )


def _start_values(data: Measured, smoothed: bool) -> dict[str, Array]:
    values: dict[str, Array] = {
        n: data.channels[n] for n in ("position", "pressure_a", "pressure_b") if n in data.channels
    }
    if smoothed:
        values = {n: savgol_filter(v, _SMOOTHING, 2) for n, v in values.items()}
    return {**values, "velocity": data.channels["velocity"]}


def _states(plant: Plant, values: dict[str, Array], inner: Array, starts: Index) -> Array:
    """Initial states ``(S, n_states)``: measured where there is a measurement, of the free run elsewhere."""
    states = inner[starts]
    for name, measurement in values.items():
        states[:, plant.state_names.index(name)] = measurement[starts]
    return states


def _tile(values: Array, starts: Index, ahead: int, stride: int, count: int) -> Array:
    """The last ``stride`` samples of every run, side by side: ``(count,)``, NaN before the first."""
    tiled = np.full(count, np.nan)
    index = starts[:, None] + np.arange(ahead - stride + 1, ahead + 1)
    tiled[index] = values[:, ahead - stride + 1 :]
    return tiled


def _compared(model: Model, data: Measured, channels: dict[str, Array]) -> dict[str, Array]:
    """What the record can be compared with, the load pressure among it."""
    if "load_pressure" in data.channels:
        channels["load_pressure"] = load_pressure(channels["pressure_a"], channels["pressure_b"], model)
    return {name: channels[name] for name in data.compared}
