"""Model-reference adaptive control: the piston is to move as a reference model does, whatever its gain and null bias.

X. Zuo et al. 2017; P. A. Ioannou, J. Sun, Robust Adaptive Control, 1996, ch. 6 and 8: direct MRAC
of a plant of relative degree one, with normalisation, dead zone, σ-modification and projection.

    ẍ_m = ω²·(x_r − x_m) + 2ω·(v_r − v_m),   u = θ₁·(v_m + λ·ε) + θ₂ + θ₃·sat(v_m/v₀),   ε = x_m − x
    dθ/dt = Γ·w·ε/(1 + wᵀw) − σ·Γ·(θ − θ⁰)
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, number
from hydraulic_control.law_parts import at_limit, clamp, outside


def begin(p: Any, s: Any, position: float) -> None:
    """The reference model at rest where the piston is."""
    s.model_position = position
    s.gain = 1.0 / p.velocity_gain


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """Advance the reference model; the drive [V]."""
    w = p.bandwidth
    s.model_velocity += dt * (
        w * w * (reference - s.model_position) + 2.0 * w * (reference_velocity - s.model_velocity)
    )
    s.model_velocity = clamp(s.model_velocity, 0.9 * p.velocity_gain * p.drive_limit)
    s.model_position += dt * s.model_velocity
    s.apart = s.model_position - position
    demand = s.model_velocity + p.slope * s.apart
    return s.gain * demand + s.bias + s.friction * clamp(s.model_velocity / p.speed, 1.0)


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Adapt, unless the drive is at its limit."""
    if at_limit(p, wanted):
        return
    first = 1.0 / p.velocity_gain
    demand, dry = (s.model_velocity + p.slope * s.apart) * first, clamp(s.model_velocity / p.speed, 1.0)
    error = dt * p.rate * outside(s.apart, p.dead_zone) / (1.0 + demand * demand + dry * dry)
    fade = dt * p.leakage
    s.gain += first * (error * demand) - fade * (s.gain - first)
    s.gain = min(max(s.gain, 0.5 * first), 2.0 * first)
    s.bias = clamp(s.bias + error - fade * s.bias, p.most)
    s.friction = min(max(s.friction + error * dry - fade * s.friction, 0.0), p.most)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several bandwidths of the model."""
    return [
        {"mrac.velocity_gain": simple.velocity_gain, "mrac.bandwidth": w, "mrac.slope": w} for w in (10.0, 20.0, 35.0)
    ]


LAW = Law(
    description="model-reference adaptive control (MRAC)",
    source="Zuo 2017; Ioannou & Sun 1996",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(
        number("mrac.velocity_gain", 0.0434, "K that the gain begins from", "m/(s*V)", 1e-6, 10.0),
        number("mrac.bandwidth", 20.0, "ω of the reference model", "rad/s", 0.1, 200.0),
        number("mrac.slope", 20.0, "λ, of the error of following the model", "1/s", 0.1, 500.0),
        number("mrac.rate", 500.0, "Γ", "V/(m*s)", 0.0, 1e6),
        number("mrac.leakage", 0.02, "σ·Γ, how fast what was learnt fades", "1/s", 0.0, 100.0),
        number("mrac.dead_zone", 3e-5, "error that changes nothing", "m", 0.0, 1.0),
        number("mrac.most", 0.5, "largest θ₂ and θ₃", "V", 0.0, 10.0),
        number("mrac.speed", 5e-3, "v₀, speed at which θ₃ is whole", "m/s", 1e-6, 10.0),
    ),
    state=tuple((n, ()) for n in ("model_position", "model_velocity", "apart", "gain", "bias", "friction")),
    tuned=("mrac.bandwidth", "mrac.slope", "mrac.rate"),
    starts=starts,
    needs="velocity gain",
    claims=(Claim("follows better than PID (Zuo 2017)", "sine", "rms_error", over="pid"),),
)
