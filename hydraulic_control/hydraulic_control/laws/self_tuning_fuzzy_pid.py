"""Self-tuning fuzzy PID: fuzzy rules on error and rate scale each gain of a PID.

A. Mohammed (Saeed) 2018; R. Adnan et al. 2011; Z.-Y. Zhao, M. Tomizuka, S. Isaka, Fuzzy gain scheduling of PID
controllers, IEEE Trans. Syst. Man Cybern. 23 (1993). Each gain is K·(1 + span·table(e, ė)).
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.fuzzy_rules import SHAPE, inferred, scales, table
from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, number
from hydraulic_control.law_parts import integrate

_TABLES = ("proportional_gain", "integral_gain", "derivative_gain")


def design(values: Values) -> dict[str, Any]:
    """The rules of each gain."""
    return {name: table(name) for name in _TABLES}


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """A PID with the gains of the moment."""
    e = reference - position
    rate = reference_velocity - s.velocity
    kp = p.kp * (1.0 + p.span * inferred(p.proportional_gain, e, p.error, rate, p.rate))
    kd = p.kd * (1.0 + p.span * inferred(p.derivative_gain, e, p.error, rate, p.rate))
    s.ki = p.ki * (1.0 + p.span * inferred(p.integral_gain, e, p.error, rate, p.rate))
    return kp * e + s.ki * s.integral - kd * s.velocity


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral."""
    integrate(p, s, dt, e, s.ki, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule."""
    return fed_forward(simple, gains)


def as_is(pid: Values) -> list[dict[str, Any]]:
    """A PID, with fixed and with scheduled gains."""
    return [{**pid, "self_tuning_fuzzy_pid.span": span} for span in (0.0, 0.4)]


LAW = Law(
    description="self-tuning fuzzy PID: gains scheduled by fuzzy rules",
    source="Mohammed 2018, Adnan 2011; Zhao, Tomizuka & Isaka 1993",
    drive=drive,
    end=end,
    parameters=(
        *scales("self_tuning_fuzzy_pid", 1.0)[:2],
        number("self_tuning_fuzzy_pid.span", 0.4, "largest change of a gain", "1", 0.0, 0.95),
    ),
    state=(("ki", ()),),
    derived=tuple((name, SHAPE) for name in _TABLES),
    design=design,
    tuned=("kp", "ki", "kd", "self_tuning_fuzzy_pid.error", "self_tuning_fuzzy_pid.span"),
    starts=starts,
    follows=("pid", as_is),
    claims=(Claim("settles sooner than PID (Zulfatman & Rahmat 2009)", "step", "settling_time", over="pid"),),
)
