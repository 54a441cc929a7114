"""Structural flexibility: a second mass on a spring and damper behind the rod.

    F = m·(ω²·d + 2·ζ·ω·ḋ),   d̈ = −ω²·d − 2·ζ·ω·ḋ − a,   ω = 2π·f

d: how far the second mass is ahead of the piston [m]; a: the piston's acceleration. The mass m comes on top of
moving_mass; without it (m = 0) nothing is felt.

Source: Merritt (1967), Hydraulic Control Systems, ch. 6 (structural resonance); Jelali & Kroll (2003),
Hydraulic Servo-systems, ch. 4.
"""

import math

from hydraulic_sim.effect import Effect, Parameter, State


def force(deflection, deflection_rate, mass, frequency, damping):
    w = 2.0 * math.pi * frequency
    return mass * (w * w * deflection + 2.0 * damping * w * deflection_rate)


def dynamics(deflection, deflection_rate, acceleration, frequency, damping):
    w = 2.0 * math.pi * frequency
    return deflection_rate, -w * w * deflection - 2.0 * damping * w * deflection_rate - acceleration


def rate(p):
    """Both masses against each other: faster than either, and stiff where the damper dominates."""
    both = (1.0 + p["mass"] / p["moving_mass"]) ** 0.5
    return 2.0 * math.pi * p["frequency"] * both * max(1.0, 2.0 * p["damping"] * both) if p["mass"] > 0.0 else 0.0


EFFECT = Effect(
    slot="force",
    summary="a second mass behind a spring and damper",
    kernel=force,
    dynamics=dynamics,
    states=(State("deflection", "m", scale=1e-3), State("deflection_rate", "m/s", scale=0.1)),
    parameters=(
        Parameter("mass", "kg", 100.0, (0.0, 1e6), "second mass, on top of moving_mass",
                  "a fifth of the paper's load", null=0.0),
        Parameter("frequency", "Hz", 20.0, (0.5, 200.0), "natural frequency of the second mass, piston held",
                  "test rigs and arms: 5 to 50 Hz"),
        Parameter("damping", "1", 0.05, (0.0, 1.0), "damping ratio; beyond 1 nothing swings",
                  "welded and bolted structures: 0.01 to 0.1"),
    ),
    equation="F = m*(w^2*d + 2*zeta*w*d'), d'' = -w^2*d - 2*zeta*w*d' - a",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6",
    excited_by="chirp through its resonance at several positions",
    confused_with=("entrained_air", "hose_compliance", "backlash"),
    distinguished_by="a resonance that does not move with the stroke",
    step_rate=rate,
)
