"""What is set against records: a model file, whose states can be set, or anything else that runs over a drive."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from scipy.signal import savgol_filter

from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.exchange.foreign import CHANNELS
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model_file import Model
from hydraulic_sim.plant import Plant, PlantState
from hydraulic_sysid.data.records import Record

from .channels import Measured, Scales

_SMOOTHING = 7  # samples; a quadratic over them keeps motion to a quarter of the sampling frequency


class Runs(Protocol):
    """A subject made ready to run beside one record."""

    def free(self, data: Measured) -> dict[str, Array]:
        """Channels ``(N,)`` from the first sample on, the drive alone."""

    def ahead(self, data: Measured, starts: Index, count: int, smoothed: bool) -> dict[str, Array]:
        """Channels ``(S, count + 1)`` of runs that begin as measured at each start, smoothed or sample by sample."""


class Subject(Protocol):
    """What can be compared with records."""

    @property
    def scales(self) -> Scales:
        """How its channels are scaled."""

    def seen(self, record: Record) -> Record:
        """The record without the channels that the subject does not have."""

    def runs(self, data: Measured) -> Runs:
        """Made ready for a record."""

    def document(self) -> dict[str, Any]:
        """Name, effects, parameters and history for the result."""


class ModelSubject:
    """A model file: each start takes what is measured, and inner states as they are in the free run at that instant."""

    def __init__(self, model: Model, plant: Plant | None = None) -> None:
        self.model = model
        self.plant = plant or Plant(model)
        self.scales = Scales.of(model)

    def seen(self, record: Record) -> Record:
        """The whole record: every channel has its place in the plant."""
        return record

    def runs(self, data: Measured) -> PlantRuns:
        """The plant, and its states in the free run."""
        return PlantRuns(self.plant.with_parameters(data.record.settings), data)

    def document(self) -> dict[str, Any]:
        """See `model_document`."""
        return model_document(self.model)


class PlantRuns:
    """The plant of a model beside a record."""

    def __init__(self, plant: Plant, data: Measured) -> None:
        self.plant, self.inner = plant, _inner_states(plant, data)

    def free(self, data: Measured) -> dict[str, Array]:
        """The plant over the whole drive."""
        run = self.plant.simulate(data.record["drive"], data.record.dt, start(self.plant, data))
        return {name: run[name] for name in CHANNELS}

    def ahead(self, data: Measured, starts: Index, count: int, smoothed: bool) -> dict[str, Array]:
        """Each run begins with what is measured, all else of the free run."""
        states = self.inner[starts]
        for name, measurement in start_values(data, smoothed).items():
            states[:, self.plant.state_names.index(name)] = measurement[starts]
        runs = self.plant.predict(data.record["drive"], data.record.dt, starts, count, states)
        return {name: runs[name] for name in CHANNELS}


def start(plant: Plant, data: Measured) -> PlantState:
    """The state at a record's first sample: measured where there is a measurement, at rest elsewhere."""
    first = {name: float(values[0]) for name, values in start_values(data, smoothed=True).items()}
    return plant.initial_state(**first, drive=float(data.record["drive"][0]))


def start_values(data: Measured, smoothed: bool) -> dict[str, Array]:
    """What a start takes from the record: position, pressures (N,), and the velocity of the derivative filter."""
    values: dict[str, Array] = {
        n: data.channels[n] for n in ("position", "pressure_a", "pressure_b") if n in data.channels
    }
    if smoothed:
        values = {n: savgol_filter(v, _SMOOTHING, 2) for n, v in values.items()}
    return {**values, "velocity": data.channels["velocity"]}


def _inner_states(plant: Plant, data: Measured) -> Array:
    """All states of the free run ``(N, n_states)``, each at its sample."""
    live = LivePlant(plant, start(plant, data))
    dt = data.record.dt
    states = np.empty((len(data.record), len(plant.state_names)))
    for k, volts in enumerate(data.record["drive"].tolist()):
        states[k] = live.state.states
        live.step(volts, dt)
    return states


def model_document(model: Model) -> dict[str, Any]:
    """Name, effects, parameters and history of a model."""
    parameters = [
        {
            "name": key,
            "value": model.value(key),
            "unit": model.parameter(key).unit,
            "source": model.entry(key).source,
            "standard_error": model.entry(key).standard_error,
        }
        for key in model.keys()  # noqa: SIM118 - a model is no mapping
    ]
    return {
        "name": model.name,
        "path": str(model.path) if model.path else None,
        "description": model.description,
        "effects": list(model.effects),
        "parameters": parameters,
        "history": [dict(line) for line in model.history],
        "fmu": False,
    }
