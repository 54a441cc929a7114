"""One step of the controller, compiled: the laws, their filters, limits and anti-windup.

    u = k(e)·(Kp·e + Ki·∫e − Kd·dx/dt) + K_ff·v_r − K_f·H(F) + b,   k(e) = k₀ + k₁·(1 − sech(k₂·e)),   e = x_r − x

[1] Z. Nisar, H. Munawar, System Identification and Controller Design for Hydraulic Actuator: the nonlinear PID.
[2] H. Seraji, A new class of nonlinear PID controllers with robotic applications, J. Robotic Systems 15 (1998).
[3] H. E. Merritt, Hydraulic Control Systems, 1967, ch. 6: dynamic pressure feedback, H(F) being the force from the
    pressures through a high pass.

The derivative acts on the measurement, so that a step of the reference is not differentiated. ``b`` is the offset that
makes enabling and changes of gains bumpless; it decays. Records are those of `parameters.RECORD` and `STATE`.
"""

import math

import numpy as np
from numba import njit

NPID, PID, POLE_PLACEMENT = 0.0, 1.0, 2.0
BACK_CALCULATION, CONDITIONAL = 1.0, 2.0
LONGEST_STEP_S = 1.0

STATE = np.dtype(
    [(name, np.float64) for name in (
        "running", "rebase", "drive", "position", "velocity", "integral", "slow_force", "offset",
        "clock", "held", "w1", "w2", "y1", "y2", "u1", "u2",
    )]
)  # fmt: skip
"""What a controller remembers: whether it runs and must join on to the last drive [V]; the last position [m], filtered
velocity [m/s], ∫e [m·s], slow part of the force [N], offset [V]; of pole placement: time since its last sample [s], its
drive [V] and the pasts of observer, position and drive."""


@njit(cache=True, error_model="numpy")
def clamp(value, limit):
    """``value`` within ±limit."""
    return min(max(value, -limit), limit)


@njit(cache=True, error_model="numpy")
def nonlinear_gain(e, k0, k1, k2):
    """k(e) = k₀ + k₁·(1 − sech(k₂·e)), [1], written with a decaying exponential: no e overflows it."""
    decay = math.exp(-abs(k2 * e)) if e != 0.0 else 1.0
    return k0 + k1 * (1.0 - 2.0 * decay / (1.0 + decay * decay))


@njit(cache=True, error_model="numpy")
def placed(p, s, dt, reference, position):
    """Drive [V] of pole placement: a new one once its period has passed, else the held one (see `pole_placement`)."""
    s.clock += dt
    if s.clock < p.pole_placement_period - 0.5 * dt:
        return s.held
    s.clock = 0.0
    w = -p.o1 * s.w1 - p.o2 * s.w2 - p.s0 * position - p.s1 * s.y1 - p.s2 * s.y2
    w += (p.o1 - p.r1) * s.u1 + (p.o2 - p.r2) * s.u2
    s.held = p.t0 * reference + w
    s.w2, s.w1, s.y2, s.y1, s.u2 = s.w1, w, s.y1, position, s.u1
    s.u1 = clamp(s.held, p.drive_limit)
    return s.held


@njit(cache=True, error_model="numpy")
def begin(p, s, position, force):
    """Start at rest where the piston is."""
    s.running, s.rebase = 1.0, 1.0
    s.position, s.velocity, s.integral = position, 0.0, 0.0
    s.slow_force = force if math.isfinite(force) else 0.0
    s.clock, s.held = p.pole_placement_period, 0.0
    s.y1 = s.y2 = position
    s.w1 = s.w2 = -p.t0 * position
    s.u1 = s.u2 = 0.0


@njit(cache=True, error_model="numpy")
def filters(p, s, dt, position, force):
    """Advance the filtered velocity; what the dynamic pressure feedback takes from the drive [V]."""
    s.velocity += dt / (p.derivative_time + dt) * ((position - s.position) / dt - s.velocity)
    s.position = position
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
def integrate(p, s, dt, e, k, wanted, drive):
    """Advance ∫e with the anti-windup chosen, and keep its contribution within the limit.

    With a zone z the error counts as e/(1 + (e/z)²): on an integrating plant all that is integrated on the way must be
    undone by an overshoot, so that only what is left near the goal is to be integrated.
    """
    gain = k * p.ki
    if gain <= 0.0:
        s.integral = 0.0
        return
    if p.integral_zone > 0.0:
        e /= 1.0 + (e / p.integral_zone) * (e / p.integral_zone)
    saturated = clamp(wanted, p.drive_limit) != wanted
    if p.antiwindup == BACK_CALCULATION:
        excess = clamp(wanted, p.drive_limit) - wanted
        s.integral += dt * (e + excess / (gain * p.tracking_time))
    elif not (p.antiwindup == CONDITIONAL and saturated and e * wanted > 0.0):
        s.integral += dt * e
    s.integral = clamp(s.integral, p.integral_limit / gain)


@njit(cache=True, error_model="numpy")
def step(p_, s_, dt, reference, reference_velocity, position, force):
    """Drive [V] for a sample ``dt`` [s] after the last one; 0 V and a fresh start for what is not finite.

    ``reference`` [m], its velocity [m/s], ``position`` [m], ``force`` [N] (NaN: not measured). ``p_`` and ``s_`` are
    arrays of one record.
    """
    p, s = p_[0], s_[0]
    if not (math.isfinite(reference) and math.isfinite(position) and 0.0 < dt <= LONGEST_STEP_S):
        s.running, s.drive = 0.0, 0.0
        return 0.0
    if s.running == 0.0:
        begin(p, s, position, force)
    damping = filters(p, s, dt, position, force)
    e = reference - position
    k = nonlinear_gain(e, p.k0, p.k1, p.k2) if p.controller == NPID else 1.0
    if p.controller == POLE_PLACEMENT:
        law = placed(p, s, dt, reference, position)
    else:
        law = k * (p.kp * e + p.ki * s.integral - p.kd * s.velocity)
    if math.isfinite(reference_velocity):
        law += p.velocity_feedforward * reference_velocity
    law -= damping
    s.offset = s.drive - clamp(law, p.drive_limit) if s.rebase else s.offset / (1.0 + dt / p.bumpless_time)
    s.rebase = 0.0
    wanted = law + s.offset
    drive = limited(p, s, dt, wanted)
    integrate(p, s, dt, e, k, wanted, drive)
    if not math.isfinite(drive + s.integral + s.velocity + s.slow_force + s.offset + s.w1 + s.held):
        s.running, s.drive = 0.0, 0.0
        return 0.0
    s.drive = drive
    return drive
