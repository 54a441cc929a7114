"""What all laws share: limits, dead band, filters, anti-windup, bumpless changes; compiled, and their parameters."""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from hydraulic_control.law import Field, choice, number
from hydraulic_interfaces.contract import DRIVE_LIMIT_V

ANTIWINDUP = ("none", "back_calculation", "conditional_integration")
_BACK_CALCULATION, _CONDITIONAL = 1.0, 2.0

PARAMETERS = (
    number("kp", 60.0, "proportional gain", "V/m", 0.0, 1e5),
    number("ki", 0.0, "integral gain", "V/(m*s)", 0.0, 1e6),
    number("kd", 0.0, "derivative gain, on the measured position", "V*s/m", 0.0, 1e4),
    number("derivative_time", 2e-3, "time constant of the filter on the derivative", "s", 0.0, 1.0),
    choice("antiwindup", "conditional_integration", ANTIWINDUP, f"of the integral: {', '.join(ANTIWINDUP)}"),
    number("tracking_time", 0.1, "time constant of back-calculation", "s", 1e-3, 100.0),
    number("integral_zone", 1e-3, "error at which integration is down to a half; 0: never", "m", 0.0, 100.0),
    number("integral_limit", 2.0, "largest contribution of the integral", "V", 0.0, DRIVE_LIMIT_V),
    number("drive_limit", DRIVE_LIMIT_V, "largest drive", "V", 0.0, DRIVE_LIMIT_V),
    number("slew_limit", 2000.0, "fastest change of the drive", "V/s", 1.0, 1e6),
    number(
        "velocity_feedforward", 0.0, "drive per reference velocity: 1/velocity gain of the plant", "V*s/m", 0.0, 1e3
    ),
    number("force_feedback", 0.0, "dynamic pressure feedback: drive per changing force", "V/N", 0.0, 1.0),
    number("force_time", 2e-3, "time constant of its high pass", "s", 1e-4, 10.0),
    number("deadband", 0.0, "half width of the dead band that is jumped", "V", 0.0, 2.0),
    number("deadband_width", 0.02, "drive over which the jump is spread", "V", 1e-4, 2.0),
    number("bumpless_time", 0.1, "decay of the offset that makes changes bumpless", "s", 1e-3, 10.0),
)
STATE: tuple[Field, ...] = tuple(
    (name, ())
    for name in ("running", "rebase", "drive", "position", "velocity", "integral", "force", "slow_force", "offset")
)
"""Whether it runs, and must join on to the last drive; that drive [V], the last position [m], filtered velocity [m/s],
∫e [m·s], last force [N] (NaN: not measured) and its slow part, the offset [V] that makes enabling bumpless."""


@njit(cache=True, error_model="numpy")
def clamp(value, limit):
    """``value`` within ±limit."""
    return min(max(value, -limit), limit)


@njit(cache=True, error_model="numpy")
def filters(p, s, dt, position, force):
    """Advance the filtered velocity; what the dynamic pressure feedback takes from the drive [V].

    H. E. Merritt, Hydraulic Control Systems, 1967, ch. 6: the force from the pressures through a high pass.
    """
    s.velocity += dt / (p.derivative_time + dt) * ((position - s.position) / dt - s.velocity)
    s.position, s.force = position, force
    if not math.isfinite(force):
        return 0.0
    fast = force - s.slow_force
    s.slow_force += dt / (p.force_time + dt) * fast
    return p.force_feedback * fast


@njit(cache=True, error_model="numpy")
def limited(p, s, dt, wanted):
    """The drive [V] that may be had of the one wanted: over the dead band, within limit and slew."""
    jumped = wanted + p.deadband * clamp(wanted / p.deadband_width, 1.0)
    return clamp(s.drive + clamp(clamp(jumped, p.drive_limit) - s.drive, p.slew_limit * dt), p.drive_limit)


@njit(cache=True, error_model="numpy")
def integrate(p, s, dt, e, gain, wanted):
    """Advance ∫e, whose contribution is ``gain``·∫e [V], with the anti-windup chosen and within its limit.

    With a zone z the error counts as e/(1 + (e/z)²): on an integrating plant all that is integrated on the way must be
    undone by an overshoot, so that only what is left near the goal is to be integrated.
    """
    if gain <= 0.0:
        s.integral = 0.0
        return
    if p.integral_zone > 0.0:
        e /= 1.0 + (e / p.integral_zone) * (e / p.integral_zone)
    excess = clamp(wanted, p.drive_limit) - wanted
    if p.antiwindup == _BACK_CALCULATION:
        s.integral += dt * (e + excess / (gain * p.tracking_time))
    elif not (p.antiwindup == _CONDITIONAL and excess != 0.0 and e * wanted > 0.0):
        s.integral += dt * e
    s.integral = clamp(s.integral, p.integral_limit / gain)


@njit(cache=True, error_model="numpy")
def ramp(value, low, high):
    """0 below ``low``, 1 above ``high``, a smooth step between."""
    part = min(max((value - low) / max(high - low, 1e-12), 0.0), 1.0)
    return part * part * (3.0 - 2.0 * part)


@njit(cache=True, error_model="numpy")
def outside(value, zone):
    """What of ``value`` lies beyond ±zone."""
    return value - clamp(value, zone)


@njit(cache=True, error_model="numpy")
def at_limit(p, wanted):
    """Whether the drive wanted is more than may be had: nothing is to be learnt from it."""
    return clamp(wanted, p.drive_limit) != wanted


def end_integral(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """`Law.end` of what has Ki·∫e alone to advance."""
    integrate(p, s, dt, e, p.ki, wanted)


def end_observer(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """`Law.end` that advances the model K/(s(Ts + 1)) with the drive that is had, and a drift that keeps it true."""
    apart = s.position - s.model_position
    s.model_position += dt * (s.model_velocity + s.drift + 2.0 * p.observer * apart)
    s.drift += dt * p.observer * p.observer * apart
    s.model_velocity += dt / (p.lag + dt) * (p.velocity_gain * s.drive - s.model_velocity)
