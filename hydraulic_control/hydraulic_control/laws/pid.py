"""PID with the derivative on the measurement, u = Kp·e + Ki·∫e − Kd·dx/dt.

M. F. Rahmat et al. 2010; S. Md Rozali et al. 2010 on an electro-hydraulic actuator. K. J. Åström, T. Hägglund, Advanced
PID Control, 2006, ch. 3: the form with anti-windup.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import MODEL, Claim, Law, SimpleModel, Values, fed_forward
from hydraulic_control.law_parts import end_integral


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The law: u = Kp·e + Ki·∫e − Kd·dx/dt."""
    return p.kp * (reference - position) + p.ki * s.integral - p.kd * s.velocity


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule, with the velocity fed forward."""
    return fed_forward(simple, gains)


LAW = Law(
    description="PID, derivative on the measurement",
    source="Rahmat 2010, Rozali 2010; Åström & Hägglund 2006",
    drive=drive,
    end=end_integral,
    parameters=(),
    tuned=("kp", "ki", "kd"),
    starts=starts,
    claims=(
        Claim(
            "almost alike in simulation and on the machine (Rahmat 2010)",
            "step",
            "rise_time",
            over=MODEL,
            high=1.15,
        ),
    ),
)
