"""Sliding mode with a PID surface, σ = e + λ·∫e + τ·ė, and a boundary layer.

H. C. Cho, K. A. Edge 2000; R. Ghazali et al. 2010: sliding mode with a PID sliding surface on an electro-hydraulic
servo. J.-J. E. Slotine, W. Li, Applied Nonlinear Control, 1991, sec. 7.2: the boundary layer φ, sat instead of sign.

    u = (v_r + λ·e)/K + η·sat(σ/φ)
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, number
from hydraulic_control.law_parts import clamp, integrate


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """Equivalent and switching part."""
    e = reference - position
    surface = e + p.integral * s.integral + p.derivative * (reference_velocity - s.velocity)
    return (reference_velocity + p.slope * e) / p.velocity_gain + p.switching * clamp(surface / p.layer, 1.0)


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral of the surface."""
    integrate(p, s, dt, e, p.switching * p.integral / p.layer, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several slopes."""
    return [{"sliding_mode.velocity_gain": simple.velocity_gain, "sliding_mode.slope": w} for w in (10.0, 20.0, 40.0)]


LAW = Law(
    description="sliding mode with a PID surface and a boundary layer",
    source="Cho & Edge 2000; Ghazali 2010; Slotine & Li 1991",
    drive=drive,
    end=end,
    parameters=(
        number("sliding_mode.velocity_gain", 0.0434, "drive to speed of the plant, K", "m/(s*V)", 1e-6, 10.0),
        number("sliding_mode.slope", 20.0, "λ of the equivalent part", "1/s", 0.1, 500.0),
        number("sliding_mode.integral", 5.0, "of the error in the surface", "1/s", 0.0, 500.0),
        number("sliding_mode.derivative", 1e-3, "of the error in the surface", "s", 0.0, 1.0),
        number("sliding_mode.switching", 0.5, "η, drive of the switching part", "V", 0.0, 10.0),
        number("sliding_mode.layer", 5e-3, "φ, half the width of the boundary layer", "m", 1e-6, 1.0),
    ),
    tuned=tuple(f"sliding_mode.{n}" for n in ("slope", "integral", "derivative", "switching", "layer")),
    starts=starts,
    needs="velocity gain",
    claims=(Claim("follows any trajectory better than PID (Ghazali 2011)", "sweep", "rms_error", over="pid"),),
)
