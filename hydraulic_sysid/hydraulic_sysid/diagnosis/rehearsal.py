"""An experiment played on the model before the bench: does it keep its limits, and will its record tell anything?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.display import percent, quantity, span
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.estimation.segments import segment_length
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.amplitude import Limits
from hydraulic_sysid.excitation.simulated_run import Sensors, SimulatedRun, simulate_plan

from .check.identifiability import not_identifiable

OK, WARN, STOP = "ok", "warn", "stop"
SENSORS = Sensors(position_noise=20e-6, position_resolution=0.0, pressure_noise=15e3)
"""What is assumed of the sensors where it is asked what a record will tell: those of a common bench."""
_SHOWN = ("drive", "position", "velocity", "pressure_a", "pressure_b")
_NEAR = 0.95  # of a limit that is worth a word


@dataclass(frozen=True)
class Check:
    """One line of the gate: ``used`` is the part of the limit that the run takes; None where there is no limit."""

    name: str
    title: str
    level: str
    text: str
    used: float | None = None

    @property
    def good(self) -> bool:
        """Whether it lets the experiment pass."""
        return self.level != STOP


def rehearse(
    plan: Plan, model: Model, position: float | None = None, progress: Callable[[str], None] | None = None
) -> dict[str, Any]:
    """The document of a plan played on a model that starts at rest at ``position`` [m] (default: the plan's centre).

    :raises hydraulic_sim.errors.SimulationError: the model cannot follow.
    """
    say = progress or (lambda _: None)
    say("playing the plan on the model")
    seen = simulate_plan(plan, Plant(model), SENSORS, position)
    limits = Limits.of(model, plan.centre)
    half = 0.5 * model.value("stroke")
    checks = [_completes(seen), _travel(plan, seen, half), _drive(plan, seen), *_pressures(seen, limits)]
    if all(check.good for check in checks):
        say("what the record will tell")
        checks.append(_identifiability(model, seen.record))
    stops = [check for check in checks if not check.good]
    text = f"{plan.name} keeps its limits on {model.name}." if not stops else " ".join(check.text for check in stops)
    return {
        **heading("rehearse"),
        "verdict": {"level": "off" if stops else "explained", "go": not stops, "text": text},
        "model": {"name": model.name, "path": None if model.path is None else str(model.path)},
        "plan": plan.as_mapping(),
        "position": plan.centre if position is None else position,
        "seconds": plan.total_time,
        "checks": [asdict(check) | {"good": check.good} for check in checks],
        "limits": {
            "drive": plan.amplitude_limit,
            "travel": [plan.centre - plan.travel_limit, plan.centre + plan.travel_limit],
            "stroke": [-half, half],
            "pressure": [limits.pressure_min, limits.pressure_max],
        },
        "prediction": seen.extremes.as_mapping(),
        "traces": {name: trace(seen.record.time, seen.record[name]) for name in _SHOWN},
    }


def _completes(seen: SimulatedRun) -> Check:
    if seen.aborted:
        return Check("completes", "plays to its end", STOP, f"On the model the run is broken off: {seen.aborted}.")
    return Check("completes", "plays to its end", OK, f"The run ends after {seen.record.duration:.3g} s as planned.")


def _travel(plan: Plan, seen: SimulatedRun, half: float) -> Check:
    low, high = seen.extremes.position_min, seen.extremes.position_max
    room = min(plan.travel_limit, half - abs(plan.centre))
    used = max(high - plan.centre, plan.centre - low) / room
    text = f"The piston moves between {span(low, high, 'm')}, {percent(used)} of what is allowed to a side."
    return Check("travel", "travel", _level(used), text, used)


def _drive(plan: Plan, seen: SimulatedRun) -> Check:
    used = seen.extremes.drive_peak / plan.amplitude_limit
    text = f"The drive reaches {quantity(seen.extremes.drive_peak, 'V')} of {quantity(plan.amplitude_limit, 'V')}."
    return Check("drive", "drive", STOP if used > 1.0 + 1e-9 else OK, text, used)


def _pressures(seen: SimulatedRun, limits: Limits) -> Sequence[Check]:
    """The largest pressure stops an experiment; a low one makes air come out of the oil, which is worth a warning."""
    low, high = seen.extremes.pressure_min, seen.extremes.pressure_max
    if limits.pressure_max == float("inf"):
        return []
    text = f"The chambers see up to {quantity(high, 'Pa')} of {quantity(limits.pressure_max, 'Pa')}."
    found = [
        Check("pressure", "largest pressure", _level(high / limits.pressure_max), text, high / limits.pressure_max)
    ]
    hollow = low < limits.pressure_min
    text = f"The least pressure is {quantity(low, 'Pa')}" + (
        f", below {quantity(limits.pressure_min, 'Pa')}: air comes out of the oil." if hollow else "."
    )
    return [*found, Check("cavitation", "least pressure", WARN if hollow else OK, text)]


def _identifiability(model: Model, record: Record) -> Check:
    """A record that tells nothing of the model is not worth making."""
    free = model.free_keys()
    vague = {f.subject for f in not_identifiable(model, [record], segment_length(model, [record]))} & set(free)
    title = "identifiability"
    if not free:
        return Check(title, title, OK, "The model has no free parameter.")
    known = 1.0 - len(vague) / len(free)
    if not vague:
        return Check(title, title, OK, f"The record will identify all {len(free)} free parameters.", known)
    names = ", ".join(sorted(vague))
    if len(vague) == len(free):
        return Check(title, title, STOP, "The record would identify none of the free parameters: move more.", 0.0)
    text = f"The record will identify {len(free) - len(vague)} of {len(free)} free parameters, not {names}."
    return Check(title, title, WARN, text, known)


def _level(used: float) -> str:
    return STOP if used > 1.0 else WARN if used > _NEAR else OK
