"""The steps of tuning: critical points, gains by rule, optimisation; what `tune` prints and writes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from numpy.typing import NDArray

from hydraulic_control import rules
from hydraulic_control.errors import ControlError
from hydraulic_control.identified import IdentifiedModel
from hydraulic_control.law import SimpleModel
from hydraulic_control.laws import laws
from hydraulic_control.margins import critical_of_identified, critical_of_model
from hydraulic_control.relay import CriticalPoint, RelaySettings, measure
from hydraulic_control.scenario import Case, identified, late, nominal, scattered
from hydraulic_control.simulation import SensorNoise, SimulatedPlant
from hydraulic_control.tuning import FORCE, Criteria, Tuned, best_start, optimise
from hydraulic_sim.linear import poles, velocity_gain
from hydraulic_sim.model import Model

FREQUENCIES = (5.0, 10.0, 20.0, 40.0)  # rad/s, of the poles that rules place
SEED = 1  # of the plants that gains are tuned on: not those that `evaluate` judges them on
_FORCE_START = 1e-5  # V/N
_STIFF = 3000.0  # rad/s, of a plant that shows no resonance


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


def simple_model(model: Model, models: Sequence[IdentifiedModel]) -> SimpleModel:
    """The model that laws are begun from.

    Gain and resonance are those of the first identified model, where it shows them, else of the physics; the lag is
    that of spool and loop.

    :raises HydraulicError: the drive of the model gives no speed.
    """
    gain = models[0].velocity_gain if models else velocity_gain(model)
    spool = 0.0
    if "spool_dynamics" in model.effects:
        spool = 2.0 * model.value("spool_dynamics.damping") / (6.283185 * model.value("spool_dynamics.frequency"))
    resonance = _resonance(models[0].poles, models[0].highest) if models else None
    resonance = resonance or _resonance(poles(model), math.inf) or (_STIFF, 1.0)
    return SimpleModel(gain, max(spool + 1.5e-3, 1e-3), *resonance)


def _resonance(found: NDArray[Any], highest: float) -> tuple[float, float] | None:
    """Frequency [rad/s] and damping of the slowest pair of poles that swings, below ``highest``."""
    pairs = [p for p in map(complex, found) if p.imag > 0.0 and abs(p) < 0.9 * highest and -p.real < 0.7 * abs(p)]
    if not pairs:
        return None
    slowest = min(pairs, key=abs)
    return abs(slowest), max(-slowest.real / abs(slowest), 1e-3)


def tune(
    law: str,
    model: Model,
    models: Sequence[IdentifiedModel],
    gains: Mapping[str, rules.Gains],
    simple: SimpleModel,
    steps: Sequence[float],
    criteria: Criteria,
    plants: int,
    trials: int,
    noise: SensorNoise,
    force: bool = True,
    fixed: Mapping[str, Any] | None = None,
    optimiser: str = "nelder_mead",
    seed: int = 0,
) -> Tuned:
    """The law's values, optimised from the best of its starts.

    A law that follows another is searched for from that one's best as well: a comparison of both is to be one of the
    laws, not of where a search got to.

    :param fixed: values that all starts have
    :param optimiser: one of `optimisers.OPTIMISERS`, with the ``seed`` of its chance
    """
    known = [nominal(model, noise), late(model, noise), *scattered(model, plants, SEED, noise)]
    cases: list[Case] = [*known, *identified(models)]
    duration = 2.5 * max(criteria.settling, criteria.rise) + 0.3
    force = force and model.kind == "hydraulic"
    by_rules: list[Mapping[str, Any]] = [asdict(g) for g in gains.values()]
    common = {FORCE: _FORCE_START if force else 0.0, **(fixed or {})}

    def search(kind: str, starts: Sequence[Mapping[str, Any]]) -> Tuned:
        begin = best_start([{**common, **s, "controller": kind} for s in starts], cases, steps, criteria, duration)
        free = (*laws()[kind].tuned, *([FORCE] if force else []))
        return optimise(begin, cases, steps, criteria, free, duration, trials, optimiser, seed)

    chosen = laws()[law]
    found = search(law, chosen.starts(simple, by_rules))
    if chosen.follows is None:
        return found
    other, adapted = chosen.follows
    leader = search(other, laws()[other].starts(simple, by_rules))
    kept = {n: v for n, v in leader.values.items() if n != "controller"}
    again = search(law, [{**chosen.starts(simple, by_rules)[0], **a} for a in adapted(kept)])
    return min(found, again, key=lambda one: one.cost)
