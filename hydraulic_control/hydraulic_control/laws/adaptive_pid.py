"""Adaptive PID: a recursive estimate of the plant's velocity gain scales the gains; a fixed PID where it cannot be had.

Y. Zuo et al. 2017: adaptive PID with switching. L. Ljung, System Identification, 2nd ed. 1999, sec. 11.2: recursive
least squares with forgetting, of v = K̂·u_f with the drive through the lag that the filtered velocity has. Where the
drive does not excite the plant the estimate is held; where the estimate leaves its bounds, or fails to predict the
speed, the law switches back to the fixed gains, gradually.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, model_parameters, model_values, number
from hydraulic_control.law_parts import integrate


def begin(p: Any, s: Any, position: float) -> None:
    """From the gain of the model."""
    s.power = p.excitation * p.excitation
    s.product = p.velocity_gain * s.power
    s.scale = 1.0


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """A PID, its gains scaled by how much the plant's differs from the model's."""
    return s.scale * (p.kp * (reference - position) + p.ki * s.integral - p.kd * s.velocity)


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance integral and estimate."""
    integrate(p, s, dt, e, s.scale * p.ki, wanted)
    s.lagged += dt / (p.lag + p.derivative_time + dt) * (s.drive - s.lagged)
    estimate = s.product / s.power
    goal = 1.0
    if abs(s.lagged) > p.excitation:
        fade = dt / p.memory
        s.power += fade * (s.lagged * s.lagged - s.power)
        s.product += fade * (s.lagged * s.velocity - s.product)
    if p.velocity_gain / p.most <= estimate <= p.velocity_gain * p.most:
        goal = p.velocity_gain / estimate
    s.scale += dt / (p.switching_time + dt) * (goal - s.scale)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule."""
    return fed_forward(simple, ({**model_values("adaptive_pid", simple), **g} for g in gains))


def as_is(pid: Values) -> list[dict[str, Any]]:
    """The gains of a PID."""
    return [dict(pid)]


LAW = Law(
    description="adaptive PID: gains scaled by the estimated gain of the plant",
    source="Zuo 2017; Ljung 1999, sec. 11.2",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(
        *model_parameters("adaptive_pid"),
        number("adaptive_pid.excitation", 0.3, "drive from which the gain is estimated", "V", 1e-3, 10.0),
        number("adaptive_pid.memory", 0.5, "of the estimate", "s", 1e-2, 100.0),
        number("adaptive_pid.most", 2.0, "largest factor either way; beyond it the gains are fixed", "1", 1.0, 10.0),
        number("adaptive_pid.switching_time", 0.2, "over which the gains change", "s", 1e-3, 10.0),
    ),
    state=tuple((n, ()) for n in ("power", "product", "lagged", "scale")),
    tuned=("kp", "ki", "kd"),
    starts=starts,
    follows=("pid", as_is),
    needs="velocity gain",
    claims=(
        Claim("responds sooner than PID (Zuo 2017)", "step", "rise_time", over="pid"),
        Claim("follows better than MRAC (Zuo 2017)", "sine", "rms_error", over="mrac"),
    ),
)
