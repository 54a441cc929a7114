"""Spool dynamics: the spool follows the demanded opening as a damped second-order system.

    s̈ = ω²·(s_d − s) − 2·ζ·ω·ṡ,   ω = 2π·f

Source: Merritt (1967), Hydraulic Control Systems, ch. 7; Moog, Technical Bulletin 103 (Thayer 1958, transfer
functions for servo valves).
"""

import math

from hydraulic_sim.effect import Effect, Parameter, State

IDEAL = 1000.0  # Hz: at this bound the spool follows without delay


def spool(lift, command, frequency):
    return lift if frequency < IDEAL else command


def dynamics(lift, lift_rate, command, frequency, damping):
    if frequency >= IDEAL:
        return 0.0, 0.0
    w = 2.0 * math.pi * frequency
    return lift_rate, w * w * (command - lift) - 2.0 * damping * w * lift_rate


def rate(p):
    """Of the faster pole."""
    damping = p["damping"]
    pole = damping + (damping * damping - 1.0) ** 0.5 if damping > 1.0 else 1.0
    return 2.0 * math.pi * p["frequency"] * pole if p["frequency"] < IDEAL else 0.0


EFFECT = Effect(
    slot="spool",
    summary="second-order response of the spool",
    kernel=spool,
    dynamics=dynamics,
    states=(State("lift", "1", initial="command"), State("lift_rate", "1/s", scale=100.0)),
    parameters=(
        Parameter("frequency", "Hz", 80.0, (5.0, IDEAL), "natural frequency f",
                  "two-stage servo valves of this class: 30 to 150 Hz", null=IDEAL),
        Parameter("damping", "1", 0.7, (0.2, 2.0), "damping ratio", "two-stage servo valves: 0.5 to 0.9"),
    ),
    equation="d2s/dt2 = w^2*(s_d - s) - 2*zeta*w*ds/dt",
    source="Merritt (1967), Hydraulic Control Systems, ch. 7",
    excited_by="chirp or steps up to the valve's bandwidth",
    confused_with=("command_delay", "sensor_lag"),
    alike_without_pressures="lag",
    distinguished_by="phase over frequency at two amplitudes",
    step_rate=rate,
)
