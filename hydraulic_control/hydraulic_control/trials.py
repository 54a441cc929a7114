"""What a controller is tried on: references, and disturbances of the plant while it holds or moves.

Each trial is a plant and a reference. Sources: the paper (step, staircase, sine); internal leakage: M. Kalyoncu, M.
Haydim, Mechatronics 19 (2009); varying load and supply: R. Ghazali et al. 2014.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hydraulic_control.controller import Controller
from hydraulic_control.response import Response
from hydraulic_control.simulation import BEGIN_S, ReferenceCurve, SensorNoise, SimulatedPlant, run, step_reference
from hydraulic_sim.model import Model

_LOAD = 0.1  # of the stall force
_DROP = 0.3  # of the supply pressure
_LEAKAGE = 0.05  # of the rated flow at the supply pressure


@dataclass(frozen=True)
class Trial:
    """A way to try a controller.

    :param reference: position and velocity at a time, for a size [m]
    :param duration: [s], after `BEGIN_S`
    :param changes: what the plant becomes, and when [s]
    :param is_step: whether figures of a step make sense
    :param noisier: factor on the noise of the sensors
    :param counts_from: time [s] from which figures are taken, once what the start did has died away
    :param of_oil: whether it disturbs what a mechanical plant does not have
    """

    name: str
    description: str
    reference: Callable[[float], ReferenceCurve]
    duration: float
    changes: Callable[[Model], list[tuple[float, Model]]] = lambda model: []
    is_step: bool = False
    noisier: float = 1.0
    counts_from: float = 0.0
    of_oil: bool = False

    def response(self, values: Mapping[str, Any], model: Model, size: float, noise: SensorNoise, seed: int) -> Response:
        """What a controller of these values does with a plant; from where figures are taken."""
        noise = replace(noise, **{n: self.noisier * v for n, v in vars(noise).items() if n != "resolution"})
        changes = self.changes(model)
        first, later = (changes[0][1], changes[1:]) if changes else (model, [])
        plant = SimulatedPlant(first, noise, seed, changes=[(BEGIN_S + t, m) for t, m in later])
        shifted = self.reference(size)
        whole = run(plant, Controller(values), lambda t: shifted(t - BEGIN_S), BEGIN_S + self.duration)
        kept = whole.time >= BEGIN_S + (-2e-3 if self.is_step else self.counts_from)
        return Response(*(c[kept] for c in (whole.time - BEGIN_S, whole.reference, whole.position, whole.drive)))


def _step(size: float) -> ReferenceCurve:
    return step_reference(size, at=0.0)


def _hold(size: float) -> ReferenceCurve:
    return lambda t: (0.0, 0.0)


def _staircase(size: float) -> ReferenceCurve:
    return lambda t: (size * min(max(int(t / 0.75) + 1, 0), 4) if t >= 0.0 else 0.0, 0.0)


def _sine(frequency: float) -> Callable[[float], ReferenceCurve]:
    w = 2.0 * np.pi * frequency

    def of(size: float) -> ReferenceCurve:
        return lambda t: (size * float(np.sin(w * t)), size * w * float(np.cos(w * t))) if t >= 0.0 else (0.0, 0.0)

    return of


def _sweep(size: float) -> ReferenceCurve:
    low, rate = 2.0 * np.pi * 0.1, 2.0 * np.pi * (2.0 - 0.1) / 8.0

    def at(t: float) -> tuple[float, float]:
        if t < 0.0:
            return 0.0, 0.0
        phase, speed = low * t + 0.5 * rate * t * t, low + rate * t
        return 0.5 * size * float(np.sin(phase)), 0.5 * size * speed * float(np.cos(phase))

    return at


def _stall_force(model: Model) -> float:
    """Force of the supply on the mean piston area, or of the drive at its limit [N]."""
    if model.kind == "mechanical":
        return abs(model.value("drive_force")) * model.value("drive_limit")
    return 0.5 * (model.value("piston_area_a") + model.value("piston_area_b")) * model.value("supply_pressure")


def _loaded(model: Model, part: float) -> Model:
    """With a load of a part of the stall force added to that which it carries."""
    before = model.value("constant_load.load") if "constant_load" in model.effects else 0.0
    return model.with_effect("constant_load", {"load": before + part * _stall_force(model)})


def _supplied(model: Model, part: float) -> Model:
    return model.with_values({"supply_pressure": part * model.value("supply_pressure")})


def _leaking(model: Model, part: float) -> Model:
    """Internal leakage that takes a part of the rated flow at half the supply pressure."""
    before = model.value("internal_leakage.coefficient") if "internal_leakage" in model.effects else 0.0
    flow = model.value("valve_flow") / (0.5 * model.value("supply_pressure"))
    return model.with_effect("internal_leakage", {"coefficient": before + part * flow})


def _load_step(model: Model) -> list[tuple[float, Model]]:
    return [(0.0, _loaded(model, 0.0)), (0.3, _loaded(model, -_LOAD))]


def _supply_drop(model: Model) -> list[tuple[float, Model]]:
    return [(0.0, model), (2.5, _supplied(model, 1.0 - _DROP))]


def _leakage(model: Model) -> list[tuple[float, Model]]:
    return [(0.0, _leaking(model, _LEAKAGE))]


def _varying(model: Model) -> list[tuple[float, Model]]:
    parts = ((0.0, 1.0), (-0.5, 1.0), (-1.0, 0.9), (0.5, 0.8), (1.0, 0.9), (0.0, 1.0))
    states = [_supplied(_loaded(model, a * _LOAD), b) for a, b in parts]
    return [(0.0, states[0]), *((2.0 + 0.7 * i, state) for i, state in enumerate(states[1:]))]


_TRIALS = (
    Trial("step", "from rest to rest", _step, 2.0, is_step=True),
    Trial("staircase", "four steps of 0.75 s", _staircase, 3.0),
    Trial("sine", "sine of 0.5 Hz, from the second period on", _sine(0.5), 6.0, counts_from=2.0),
    Trial("sweep", "sine of half the size, 0.1 to 2 Hz in 8 s", _sweep, 8.0),
    Trial("load_step", f"holding; load of {_LOAD:.0%} of the stall force at 0.3 s", _hold, 2.0, _load_step),
    Trial(
        "supply_drop",
        f"sine of 0.5 Hz; supply falls by {_DROP:.0%} at 2.5 s",
        _sine(0.5),
        6.0,
        _supply_drop,
        counts_from=2.0,
        of_oil=True,
    ),
    Trial("leakage", f"step with leakage of {_LEAKAGE:.0%} of the rated flow", _step, 2.0, _leakage, True, of_oil=True),
    Trial("varying", "sine of 0.5 Hz; load and supply vary", _sine(0.5), 6.2, _varying, counts_from=2.0),
    Trial("noise", "step, sensors three times as noisy", _step, 2.0, is_step=True, noisier=3.0),
)
TRIALS: dict[str, Trial] = {trial.name: trial for trial in _TRIALS}
"""By their names."""


def trials_of(model: Model) -> dict[str, Trial]:
    """The trials that mean something on a model."""
    return {name: trial for name, trial in TRIALS.items() if model.kind == "hydraulic" or not trial.of_oil}
