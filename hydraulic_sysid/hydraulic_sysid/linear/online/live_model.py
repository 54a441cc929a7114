"""The physical model run beside the plant, on the drive that was applied.

Every ``horizon`` seconds it starts again from the measurement, because the position of an integrating plant drifts
away from any model; between two starts it runs free. What is not measured (spool, effects' states and memories) goes
on from the model, as the drive alone determines it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from hydraulic_interfaces.samples import NAN, PlantSample
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trajectory import PlantState

_SLOPE_SAMPLES = 15


class LiveModel:
    """One running model; `take` every state of the plant in turn."""

    def __init__(self, model: Model, horizon: float = 1.0, longest_gap: float = 0.02) -> None:
        self.plant = Plant(model)
        self.horizon = horizon
        """Seconds between two starts from the measurement; 0: never again."""
        self.longest_gap = longest_gap
        self.restarts = 0
        self._live = LivePlant(self.plant)
        self._last: PlantSample | None = None
        self._started_ns = 0
        self._past: deque[tuple[int, float]] = deque(maxlen=_SLOPE_SAMPLES)
        self._spool_travel = model.value("spool_travel")
        self._hydraulic = model.kind == "hydraulic"

    def take(self, sample: PlantSample) -> tuple[PlantSample, PlantSample] | None:
        """Predicted values and residual (measured − predicted) at the sample *before* this one.

        The model needs to know how long a drive was held before it can go on, which the next sample shows. None at
        first and after a gap. A quantity that is not measured has a NaN residual.
        """
        last, self._last = self._last, sample
        dt = (sample.stamp_ns - last.stamp_ns) * 1e-9 if last is not None else 0.0
        self._past.append((sample.stamp_ns, sample.position))
        if last is None or not 0.0 < dt <= self.longest_gap:
            self._past.clear()
            self._past.append((sample.stamp_ns, sample.position))
            self._start(sample)
            return None
        if self.horizon and (last.stamp_ns - self._started_ns) * 1e-9 >= self.horizon:
            self._start(last)
        try:
            now = self._live.step(last.drive, dt)
        except SimulationError:
            self._start(sample)
            return None
        predicted = PlantSample(
            last.stamp_ns,
            position=now.position,
            velocity=now.velocity,
            force=now.force if self._hydraulic else NAN,
            drive=now.drive,
            spool=now.spool * self._spool_travel if self._hydraulic else NAN,
        )
        return predicted, _difference(last, predicted)

    def _start(self, measured: PlantSample) -> None:
        """Go on from what is measured; the rest is what the model has."""
        state = self._live.state
        x = state.states.copy()
        named = self.plant.layout.states
        found = {"position": measured.position, "velocity": self._velocity(measured)}
        if self.restarts == 0:
            state = self.plant.initial_state(position=measured.position, drive=measured.drive)
            x = state.states.copy()
        if self._hydraulic:
            found |= self._pressures(measured, x[named["pressure_a"]], x[named["pressure_b"]])
        for name, value in found.items():
            if np.isfinite(value):
                x[named[name]] = value
        self._live = LivePlant(self.plant, PlantState(x, state.memory.copy(), state.time))
        self._started_ns = measured.stamp_ns
        self.restarts += 1

    def _pressures(self, measured: PlantSample, model_a: float, model_b: float) -> dict[str, float]:
        """As measured; where only their force is, the model's, each moved by what makes up for the difference."""
        a, b = measured.pressure_a, measured.pressure_b
        if np.isfinite(a) and np.isfinite(b) or not np.isfinite(measured.force):
            return {"pressure_a": a, "pressure_b": b}
        area_a, area_b = self.plant.value("piston_area_a"), self.plant.value("piston_area_b")
        off = (measured.force - (model_a * area_a - model_b * area_b)) / (area_a + area_b)
        return {"pressure_a": max(model_a + off, 0.0), "pressure_b": max(model_b - off, 0.0)}

    def _velocity(self, measured: PlantSample) -> float:
        """As measured, or the slope of the last positions."""
        if np.isfinite(measured.velocity):
            return measured.velocity
        if len(self._past) < 3:
            return 0.0
        t = np.array([(stamp - measured.stamp_ns) * 1e-9 for stamp, _ in self._past])
        return float(np.polyfit(t, [x for _, x in self._past], 1)[0])


def _difference(measured: PlantSample, predicted: PlantSample) -> PlantSample:
    names = ("position", "velocity", "force", "drive", "spool")
    return replace(predicted, **{name: getattr(measured, name) - getattr(predicted, name) for name in names})
