"""The closed loop in one process: a controller at 1 kHz on a nonlinear plant or on an identified linear model.

As through topics, a drive that answers the sample of one instant is applied from the next one on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hydraulic_control.compiled_loop import physical
from hydraulic_control.controller import Controller
from hydraulic_control.response import Array, Response
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant

PERIOD_S = 1e-3
BEGIN_S = 1.0
"""Of rest before anything is tried: long enough for an integral to have taken up the valve's bias."""
ReferenceCurve = Callable[[float], tuple[float, float]]
"""Position [m] and velocity [m/s] at a time [s]."""


class LoopPlant(Protocol):
    """What a loop can be closed around."""

    def close_loop(self, controller: Controller, wanted: Array, dt: float) -> tuple[Array, int]:
        """Run from its start in a loop with ``controller``.

        :param wanted: (N, 2) reference [m] and its velocity [m/s]
        :return: (N, 2) true position [m] and applied drive [V], and how many samples could be followed
        """


@dataclass(frozen=True)
class SensorNoise:
    """Noise of the bench: standard deviations of position [m] and of each pressure [Pa], resolution of position [m]."""

    position: float = 2e-5
    resolution: float = 2.4e-5
    pressure: float = 15e3


QUIET = SensorNoise(0.0, 0.0, 0.0)


class SimulatedPlant:
    """A physical model behind its sensors, from rest at ``position`` [m]; the same seed gives the same noise.

    :param changes: in a closed loop, what the model becomes at which times [s] after the first, in their order: a load
        that is taken up, a supply that gives way; of the same library and with the same effects
    """

    def __init__(
        self,
        model: Model,
        noise: SensorNoise = SensorNoise(),
        seed: int = 0,
        position: float = 0.0,
        changes: Sequence[tuple[float, Model]] = (),
    ) -> None:
        self._plant = Plant(model)
        self._parts = [(0.0, self._plant), *((at, Plant(later)) for at, later in changes)]
        self._start = self._plant.initial_state(position=position)
        self._live = LivePlant(self._plant, self._start)
        self._areas = np.array([self._plant.value("piston_area_a"), self._plant.value("piston_area_b")])
        self._seed, self._resolution = seed, noise.resolution
        self._generator = np.random.default_rng(seed)
        self._scale = np.array([noise.position, noise.pressure * float(np.hypot(*self._areas))])

    def step(self, drive: float, dt: float) -> tuple[float, float, float]:
        """Position [m], force from the pressures [N] and applied drive [V] now; then advance with ``drive`` [V].

        :raises SimulationError: the physics cannot be followed.
        """
        now = self._live.step(drive, dt)
        of_position, of_force = self._scale * self._generator.standard_normal(2)
        position = now.position + of_position
        if self._resolution > 0.0:
            position = round(position / self._resolution) * self._resolution
        return position, now.force + of_force, now.drive

    def close_loop(self, controller: Controller, wanted: Array, dt: float) -> tuple[Array, int]:
        """See `LoopPlant`; compiled, always from where the plant was made and with the same noise."""
        noise = self._scale * np.random.default_rng(self._seed).standard_normal((len(wanted), 2))
        out = np.full((len(wanted), 2), np.nan)
        x, memory, u = self._start.states.copy(), self._start.memory.copy(), np.zeros(1)
        edges = [min(round(at / dt), len(wanted)) for at, _ in self._parts] + [len(wanted)]
        for (_, plant), first, last in zip(self._parts, edges, edges[1:], strict=False):
            part = slice(first, last)
            done = physical(
                *plant.embedded(), x, memory, u, first, self._areas, self._resolution, *controller.compiled, dt,
                wanted[part], noise[part], out[part],
            )  # fmt: skip
            if done < last - first:
                return out, first + int(done)
        return out, len(wanted)


def run(
    plant: LoopPlant, controller: Controller, reference: ReferenceCurve, duration: float, dt: float = PERIOD_S
) -> Response:
    """Play ``reference`` for ``duration`` [s]; the controller is stopped first and begins with the first sample.

    The controller sees the sensors, the response holds the true position: figures are not to be those of the noise.
    A plant that cannot be followed any more ends the loop there: what is missing of the response is not a number.
    """
    time = dt * np.arange(round(duration / dt), dtype=float)
    wanted = np.array([reference(t) for t in time.tolist()]).reshape(-1, 2)
    controller.stop()
    out, done = plant.close_loop(controller, wanted, dt)
    out[done:] = np.nan
    return Response(time, wanted[:, 0].copy(), out[:, 0].copy(), out[:, 1].copy())


def step_reference(amplitude: float, start: float = 0.0, at: float = 0.1) -> ReferenceCurve:
    """A step of ``amplitude`` [m] from ``start`` [m] at the time ``at`` [s]."""
    return lambda t: (start + amplitude if t >= at else start, 0.0)
