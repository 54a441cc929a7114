"""The steps of tuning: critical points, gains by rule, optimisation; what `tune` prints and writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from hydraulic_control import rules
from hydraulic_control.errors import ControlError
from hydraulic_control.identified import IdentifiedModel
from hydraulic_control.margins import critical_of_identified, critical_of_model
from hydraulic_control.relay import CriticalPoint, RelaySettings, measure
from hydraulic_control.scenario import Case, identified, nominal, scattered
from hydraulic_control.simulation import SensorNoise, SimulatedPlant
from hydraulic_control.tuning import FREE, Criteria, Tuned, best_start, optimise
from hydraulic_sim.linear import closed_form
from hydraulic_sim.model import Model

FREQUENCIES = (5.0, 10.0, 20.0, 40.0)  # rad/s, of the poles that rules place
SEED = 1  # of the plants that gains are tuned on: not those that `evaluate` judges them on
SHAPES = ({"k1": 3.0, "k2": 50.0}, {"k1": 0.3, "k2": 50.0})
"""Of the nonlinear gain: the paper's, and a mild one."""
_FORCE_START = 1e-5  # V/N


@dataclass(frozen=True)
class CriticalResult:
    """A critical point and where it is from; None where the model has none."""

    source: str
    point: CriticalPoint | None
    remark: str = ""


def critical_points(
    model: Model,
    models: Sequence[IdentifiedModel],
    noise: SensorNoise,
    relay: RelaySettings | None,
    measured: CriticalPoint | None,
) -> list[CriticalResult]:
    """Critical points of the linearised plant, the identified models, and a relay experiment.

    :param relay: run the experiment here on the plant
    :param measured: its result on a bench instead
    """
    found = [CriticalResult("linearised at rest", critical_of_model(model), "dry friction left out")]
    for one in models:
        point = critical_of_identified(one)
        remark = "" if point else f"no crossing below its Nyquist frequency, {one.highest:.0f} rad/s"
        found.append(CriticalResult(f"identified {one.name}", point, remark))
    if measured is not None:
        found.append(CriticalResult("relay on the bench", measured))
    elif relay is not None:
        point, remark = None, f"±{relay.amplitude:g} V"
        try:
            point = measure(SimulatedPlant(model, noise), relay)
        except ControlError as error:
            remark = str(error)
        found.append(CriticalResult("relay on the plant", point, remark))
    return found


def by_rule(found: Sequence[CriticalResult], velocity_gain: float, lag: float) -> dict[str, rules.Gains]:
    """Gains by every rule from every critical point, and by pole placement, named for the tables."""
    made = {
        f"{rule} · {one.source}": function(one.point)
        for one in found
        if one.point is not None
        for rule, function in rules.RULES.items()
    }
    for frequency in FREQUENCIES:
        made[f"pole_placement · {frequency:g} rad/s"] = rules.pole_placement(velocity_gain, lag, frequency)
    return made


def simple_model(model: Model, models: Sequence[IdentifiedModel]) -> tuple[float, float]:
    """Velocity gain [m/(s·V)] and lag [s] of the model K/(s(Ts + 1)).

    The gain is that of the first identified model, else of the physics; the lag is that of spool and loop.
    """
    gain = models[0].velocity_gain if models else closed_form(model).velocity_gain
    spool = 0.0
    if "spool_dynamics" in model.effects:
        spool = 2.0 * model.value("spool_dynamics.damping") / (6.283185 * model.value("spool_dynamics.frequency"))
    return gain, max(spool + 1.5e-3, 1e-3)


def tune(
    law: str,
    model: Model,
    models: Sequence[IdentifiedModel],
    gains: Mapping[str, rules.Gains],
    simple: tuple[float, float],
    steps: Sequence[float],
    criteria: Criteria,
    plants: int,
    trials: int,
    noise: SensorNoise,
    force: bool = True,
) -> Tuned:
    """The law's values, optimised from the best start that the rules give.

    NPID is searched for from the best PID as well: a PID is an NPID with k = 1, and a comparison of both is to be one
    of the laws, not of where a search got to.
    """
    cases: list[Case] = [nominal(model, noise), *scattered(model, plants, SEED, noise), *identified(models)]
    duration = 2.5 * max(criteria.settling, criteria.rise) + 0.3
    force = force and model.kind == "hydraulic"

    def search(kind: str, candidates: Sequence[Mapping[str, Any]]) -> Tuned:
        begin = best_start(candidates, cases, steps, criteria, duration)
        free = [name for name in FREE[kind] if force or name != "force_feedback"]
        return optimise(begin, cases, steps, criteria, free, duration, trials)

    found = search(law, starts(law, gains, simple, force))
    if law != "npid":
        return found
    linear = search("pid", starts("pid", gains, simple, force))
    softened = [linear.values | {"controller": "npid"} | _shaped(linear.values, shape) for shape in SHAPES]
    same = replace(linear, values=linear.values | {"controller": "npid", "k1": 0.0})
    return min(found, search("npid", softened), same, key=lambda one: one.cost)


def _shaped(values: Mapping[str, Any], shape: Mapping[str, float]) -> dict[str, float]:
    """The gain's shape, and the gains divided by what it multiplies them with half way up."""
    return {**shape, **{n: values[n] / (1.0 + 0.5 * shape["k1"]) for n in ("kp", "ki", "kd")}}


def starts(
    law: str, gains: Mapping[str, rules.Gains], simple: tuple[float, float], force: bool
) -> list[dict[str, Any]]:
    """Where the search may begin: the rules' gains for PID, softened at small errors for NPID, poles for placement."""
    common: dict[str, Any] = {"controller": law, "force_feedback": _FORCE_START if force else 0.0}
    if law == "pole_placement":
        model = {"pole_placement.velocity_gain": simple[0], "pole_placement.lag": simple[1]}
        return [
            common | model | {"pole_placement.frequency": f, "pole_placement.observer": 3.0 * f} for f in FREQUENCIES
        ]
    # Polynomials take what is fed forward for a disturbance and fight it.
    common["velocity_feedforward"] = 1.0 / simple[0]
    if law == "pid":
        return [common | asdict(g) for g in gains.values()]
    return [common | _shaped(asdict(g), shape) for g in gains.values() for shape in SHAPES]
