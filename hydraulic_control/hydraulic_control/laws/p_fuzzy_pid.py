"""Proportional – fuzzy – PID: proportional far from the goal, fuzzy on the way, PID near it.

L. Wang et al. 2009: the three are switched by the size of the error; here each fades smoothly into the next.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.fuzzy_rules import SHAPE, drive_rules, inferred, scales
from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, number
from hydraulic_control.law_parts import integrate, ramp


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The law of this error, or a mixture of two."""
    e = reference - position
    far = ramp(abs(e), 0.8 * p.far, 1.2 * p.far)
    s.near = 1.0 - ramp(abs(e), 0.5 * p.near, 1.5 * p.near)
    fuzzy = p.output * inferred(p.rules, e, p.error, reference_velocity - s.velocity, p.rate)
    pid = p.kp * e + p.ki * s.integral - p.kd * s.velocity
    return far * p.gain * e + (1.0 - far) * (s.near * pid + (1.0 - s.near) * (fuzzy + p.ki * s.integral))


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral, which counts near the goal."""
    integrate(p, s, dt, s.near * e, p.ki, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule for the PID."""
    return fed_forward(simple, ({"p_fuzzy_pid.gain": max(g["kp"], 50.0), **g} for g in gains))


def around(pid: Values) -> list[dict[str, Any]]:
    """A PID near the goal."""
    return [{**pid, "p_fuzzy_pid.gain": 3.0 * pid["kp"]}]


LAW = Law(
    description="proportional – fuzzy – PID, mixed by the size of the error",
    source="Wang 2009",
    drive=drive,
    end=end,
    parameters=(
        *scales("p_fuzzy_pid", 10.0),
        number("p_fuzzy_pid.gain", 300.0, "proportional gain far from the goal", "V/m", 0.0, 1e5),
        number("p_fuzzy_pid.far", 0.03, "error beyond which it is proportional", "m", 1e-5, 10.0),
        number("p_fuzzy_pid.near", 3e-3, "error below which it is a PID", "m", 1e-6, 10.0),
    ),
    state=(("near", ()),),
    derived=(("rules", SHAPE),),
    design=drive_rules,
    tuned=("kp", "ki", "kd", "p_fuzzy_pid.error", "p_fuzzy_pid.near", "p_fuzzy_pid.far"),
    starts=starts,
    follows=("pid", around),
    claims=(Claim("faster to the goal than PID (Wang 2009)", "step", "settling_time", over="pid"),),
)
