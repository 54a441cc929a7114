"""Sliding mode whose switching gain adapts, with an adapted compensation of friction and null bias.

R. Ghazali et al. 2013: adaptive discrete sliding mode on an electro-hydraulic actuator. F. Plestan et al., New
methodologies for adaptive sliding mode control, Int. J. Control 83 (2010): the gain grows outside the layer and fades
inside it. The compensation f̂·sat(v_d/v₀) + b̂ follows the gradient of σ², with a dead zone and bounds.

    u = v_d/K + η̂·sat(σ/φ) + f̂·sat(v_d/v₀) + b̂,   v_d = v_r + λ·e,   σ = e + τ·(v_r − v)
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, number
from hydraulic_control.law_parts import at_limit, clamp, outside


def begin(p: Any, s: Any, position: float) -> None:
    """The least gain, nothing compensated."""
    s.gain = 0.1 * p.most_gain


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """Equivalent, switching and compensating part."""
    e = reference - position
    s.demand = reference_velocity + p.slope * e
    s.surface = e + p.derivative * (reference_velocity - s.velocity)
    compensation = s.friction * clamp(s.demand / p.speed, 1.0) + s.bias
    return s.demand / p.velocity_gain + s.gain * clamp(s.surface / p.layer, 1.0) + compensation


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Adapt, unless the drive is at its limit."""
    if at_limit(p, wanted):
        return
    beyond = abs(s.surface) / p.layer - 1.0
    s.gain += dt * p.gain_rate * max(beyond, -s.gain / p.most_gain)
    s.gain = min(max(s.gain, 0.02 * p.most_gain), p.most_gain)
    error = clamp(outside(s.surface, p.dead_zone), p.layer)
    s.friction = min(max(s.friction + dt * p.rate * error * clamp(s.demand / p.speed, 1.0), 0.0), p.most_friction)
    s.bias = clamp(s.bias + dt * p.rate * error, p.most_friction)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several slopes."""
    name = "adaptive_sliding_mode"
    return [{f"{name}.velocity_gain": simple.velocity_gain, f"{name}.slope": w} for w in (10.0, 20.0, 40.0)]


LAW = Law(
    description="adaptive sliding mode with friction compensation",
    source="Ghazali 2013; Plestan et al. 2010",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(
        number("adaptive_sliding_mode.velocity_gain", 0.0434, "drive to speed, K", "m/(s*V)", 1e-6, 10.0),
        number("adaptive_sliding_mode.slope", 20.0, "λ of the equivalent part", "1/s", 0.1, 500.0),
        number("adaptive_sliding_mode.derivative", 1e-3, "τ of the surface", "s", 0.0, 1.0),
        number("adaptive_sliding_mode.layer", 5e-3, "φ, half the width of the boundary layer", "m", 1e-6, 1.0),
        number("adaptive_sliding_mode.most_gain", 1.0, "largest η̂", "V", 1e-3, 10.0),
        number("adaptive_sliding_mode.gain_rate", 2.0, "how fast η̂ adapts", "V/s", 0.0, 1e3),
        number("adaptive_sliding_mode.rate", 200.0, "how fast f̂ and b̂ adapt", "V/(m*s)", 0.0, 1e6),
        number("adaptive_sliding_mode.dead_zone", 3e-5, "error that changes nothing", "m", 0.0, 1.0),
        number("adaptive_sliding_mode.most_friction", 0.5, "largest f̂ and b̂", "V", 0.0, 10.0),
        number("adaptive_sliding_mode.speed", 5e-3, "v₀, speed at which f̂ is whole", "m/s", 1e-6, 10.0),
    ),
    state=tuple((name, ()) for name in ("gain", "demand", "surface", "friction", "bias")),
    tuned=tuple(f"adaptive_sliding_mode.{n}" for n in ("slope", "derivative", "layer", "most_gain", "rate")),
    starts=starts,
    needs="velocity gain",
    claims=(
        Claim(
            "robust to varying load and pressure, beside PID (Ghazali 2013)",
            "varying",
            "rms_error",
            over="pid",
        ),
    ),
)
