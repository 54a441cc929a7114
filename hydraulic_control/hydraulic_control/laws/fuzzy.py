"""Fuzzy controller on the error and its rate, with an integral beside it.

M. Kalyoncu, M. Haydim, Mathematical modelling and fuzzy logic based position control of an electrohydraulic servosystem
with internal leakage, Mechatronics 19 (2009): 7 × 7 rules; here with Sugeno's inference (`fuzzy_rules`).
"""

from __future__ import annotations

import math
from typing import Any

from hydraulic_control.fuzzy_rules import SHAPE, drive_rules, inferred, scales
from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward
from hydraulic_control.law_parts import end_integral


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """Conclusion of the rules and integral."""
    fuzzy = inferred(p.rules, reference - position, p.error, reference_velocity - s.velocity, p.rate)
    return p.output * fuzzy + p.ki * s.integral


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several sizes of a big error."""
    return fed_forward(simple, ({"ki": 200.0, "fuzzy.error": size} for size in (0.02, 0.05, 0.1)))


LAW = Law(
    description="fuzzy controller on error and rate, 7 × 7 rules",
    source="Kalyoncu 2009; MacVicar-Whelan 1976; Sugeno & Takagi 1985",
    drive=drive,
    end=end_integral,
    parameters=scales("fuzzy", 10.0),
    derived=(("rules", SHAPE),),
    design=drive_rules,
    tuned=("fuzzy.error", "fuzzy.rate", "fuzzy.output", "ki"),
    starts=starts,
    claims=(
        Claim(
            "internal leakage matters to position control (Kalyoncu 2009)",
            "leakage",
            "steady_state_error",
            over_trial="step",
            low=1.5,
            high=math.inf,
        ),
    ),
)
