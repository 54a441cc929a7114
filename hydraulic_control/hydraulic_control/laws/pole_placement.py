"""Pole placement: a two-degree-of-freedom digital controller with integral action (`polynomials`).

Åström & Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, ch. 5. The drive u as limited goes through the observer,
A_o·v = T·r − S·y + (A_o − R)·u with u = sat(v), which keeps the integral from winding up.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, model_parameters, model_values, number
from hydraulic_control.law_parts import clamp
from hydraulic_control.polynomials import design

_FREQUENCIES = (5.0, 10.0, 20.0, 40.0)  # rad/s, where a search begins
_PASTS = ("clock", "held", "w1", "w2", "y1", "y2", "u1", "u2")
"""Time since the last sample [s], its drive [V], and the pasts of observer, position and drive."""


def derived(values: Values) -> dict[str, float]:
    """The polynomials for the law's parameters."""
    return asdict(design(**{name: values[f"pole_placement.{name}"] for name in _DESIGNED}))


def begin(p: Any, s: Any, position: float) -> None:
    """At rest where the piston is."""
    s.clock = p.period
    s.y1 = s.y2 = position
    s.w1 = s.w2 = -p.t0 * position


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """A new drive [V] once its period has passed, else the held one."""
    s.clock += dt
    if s.clock < p.period - 0.5 * dt:
        return s.held
    s.clock = 0.0
    w = -p.o1 * s.w1 - p.o2 * s.w2 - p.s0 * position - p.s1 * s.y1 - p.s2 * s.y2
    w += (p.o1 - p.r1) * s.u1 + (p.o2 - p.r2) * s.u2
    s.held = p.t0 * reference + w
    s.w2, s.w1, s.y2, s.y1, s.u2 = s.w1, w, s.y1, position, s.u1
    s.u1 = clamp(s.held, p.drive_limit)
    return s.held


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Poles of several frequencies; polynomials take what is fed forward for a disturbance and fight it."""
    model = model_values("pole_placement", simple)
    return [{**model, "pole_placement.frequency": f, "pole_placement.observer": 3.0 * f} for f in _FREQUENCIES]


_DESIGNED = ("velocity_gain", "lag", "frequency", "damping", "observer", "period")

LAW = Law(
    description="pole placement: digital controller with integral action",
    source="Ishak 2006; Åström & Wittenmark 1997, ch. 5",
    begin=begin,
    drive=drive,
    parameters=(
        *model_parameters("pole_placement"),
        number("pole_placement.frequency", 10.0, "of the closed loop's poles", "rad/s", 0.1, 500.0),
        number("pole_placement.damping", 1.0, "of the closed loop's poles", "1", 0.1, 2.0),
        number("pole_placement.observer", 30.0, "of the observer's poles", "rad/s", 0.1, 1000.0),
        number("pole_placement.period", 0.01, "sampling time of the polynomials", "s", 1e-3, 1.0),
    ),
    state=tuple((name, ()) for name in _PASTS),
    derived=tuple((name, ()) for name in ("t0", "s0", "s1", "s2", "r1", "r2", "o1", "o2")),
    design=derived,
    tuned=("pole_placement.frequency", "pole_placement.observer"),
    starts=starts,
    needs="identified model",
    claims=(Claim("more accurate than PID (Ishak 2006)", "sine", "rms_error", over="pid"),),
)
