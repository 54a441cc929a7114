"""PID with the derivative on the measurement, u = Kp·e + Ki·∫e − Kd·dx/dt.

M. F. Rahmat et al. 2010; S. Md Rozali et al. 2010 on an electro-hydraulic actuator. K. J. Åström, T. Hägglund, Advanced
PID Control, 2006, ch. 3: the form with anti-windup.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import Law, SimpleModel, Values
from hydraulic_control.law_parts import integrate


def begin(p: Any, s: Any, position: float) -> None:
    """Nothing of its own."""


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """U = Kp·e + Ki·∫e − Kd·dx/dt."""
    return p.kp * (reference - position) + p.ki * s.integral - p.kd * s.velocity


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral."""
    integrate(p, s, dt, e, p.ki, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule, with the velocity fed forward."""
    return [{"velocity_feedforward": 1.0 / simple.velocity_gain, **g} for g in gains]


LAW = Law(
    description="PID, derivative on the measurement",
    source="Rahmat 2010, Rozali 2010; Åström & Hägglund 2006",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(),
    tuned=("kp", "ki", "kd"),
    starts=starts,
)
