"""Hybrid fuzzy PID: the conclusion of fuzzy rules added to a PID.

R. Ghazali et al. 2014; R. Adnan et al. 2011 on an electro-hydraulic actuator: the rules act where the error is large,
the PID gives the accuracy at rest.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.fuzzy_rules import SHAPE, drive_rules, inferred, scales
from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward
from hydraulic_control.law_parts import end_integral


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The sum of both."""
    e = reference - position
    fuzzy = p.output * inferred(p.rules, e, p.error, reference_velocity - s.velocity, p.rate)
    return fuzzy + p.kp * e + p.ki * s.integral - p.kd * s.velocity


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Half of the gains by rule."""
    return fed_forward(simple, ({n: 0.5 * g[n] for n in ("kp", "ki", "kd")} for g in gains))


def as_is(pid: Values) -> list[dict[str, Any]]:
    """A PID, with and without rules."""
    return [{**pid, "hybrid_fuzzy_pid.output": output} for output in (0.0, 1.0)]


LAW = Law(
    description="hybrid fuzzy PID: fuzzy rules added to a PID",
    source="Ghazali 2014, Adnan 2011",
    drive=drive,
    end=end_integral,
    parameters=scales("hybrid_fuzzy_pid", 2.0),
    derived=(("rules", SHAPE),),
    design=drive_rules,
    tuned=("kp", "ki", "kd", "hybrid_fuzzy_pid.error", "hybrid_fuzzy_pid.output"),
    starts=starts,
    follows=("pid", as_is),
    claims=(
        Claim(
            "better than PID under varying load and pressure (Ghazali 2014)",
            "varying",
            "rms_error",
            over="pid",
        ),
    ),
)
