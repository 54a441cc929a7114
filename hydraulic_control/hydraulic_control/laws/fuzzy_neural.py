"""Fuzzy neural network: the conclusions of the rules are weights that learn while the loop runs.

Y. Zhong et al. 2008 on an electro-hydraulic servo; J.-S. R. Jang, ANFIS, IEEE Trans. Syst. Man Cybern. 23 (1993). The
weights of the four rules that fire follow the gradient, dw = Γ·μ·(e + τ·ė), with a dead zone, and stay within ±1.2;
what was learnt fades slowly to the table.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.fuzzy_rules import SETS, SHAPE, drive_rules, inferred, place, scales
from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, number
from hydraulic_control.law_parts import at_limit, clamp, integrate, outside


def begin(p: Any, s: Any, position: float) -> None:
    """The weights of the table."""
    for i in range(SETS):
        for j in range(SETS):
            s.weights[i, j] = p.rules[i, j]


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """Conclusion of the rules as learnt, and integral."""
    s.error, s.rate = reference - position, reference_velocity - s.velocity
    return p.output * inferred(s.weights, s.error, p.error, s.rate, p.rate) + p.ki * s.integral


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral; learn, unless the drive is at its limit."""
    integrate(p, s, dt, e, p.ki, wanted)
    if at_limit(p, wanted):
        return
    i, a = place(s.error, p.error)
    j, b = place(s.rate, p.rate)
    slip = outside(s.error + p.derivative * s.rate, p.dead_zone) / p.error
    for m in range(2):
        for n in range(2):
            fires = (a if m else 1.0 - a) * (b if n else 1.0 - b)
            weight, first = s.weights[i + m, j + n], p.rules[i + m, j + n]
            weight += dt * fires * (p.rate_of_learning * slip - p.leakage * (weight - first))
            s.weights[i + m, j + n] = clamp(weight, 1.2)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several sizes of a big error."""
    return fed_forward(simple, ({"ki": 200.0, "fuzzy_neural.error": size} for size in (0.02, 0.05, 0.1)))


LAW = Law(
    description="fuzzy neural network: rules that learn while the loop runs",
    source="Zhong 2008; Jang 1993",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(
        *scales("fuzzy_neural", 10.0),
        number("fuzzy_neural.rate_of_learning", 2.0, "Γ", "1/s", 0.0, 1e4),
        number("fuzzy_neural.derivative", 5e-3, "τ", "s", 0.0, 1.0),
        number("fuzzy_neural.leakage", 0.1, "how fast what was learnt fades", "1/s", 0.0, 100.0),
        number("fuzzy_neural.dead_zone", 3e-5, "error that changes nothing", "m", 0.0, 1.0),
    ),
    state=(("error", ()), ("rate", ()), ("weights", SHAPE)),
    derived=(("rules", SHAPE),),
    design=drive_rules,
    tuned=tuple(f"fuzzy_neural.{n}" for n in ("error", "rate", "output", "rate_of_learning")) + ("ki",),
    starts=starts,
    claims=(Claim("suppresses disturbances better than PID (Zhong 2008)", "load_step", "largest_error", over="pid"),),
)
