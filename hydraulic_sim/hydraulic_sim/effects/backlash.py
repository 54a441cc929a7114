"""Backlash: a gap between the rod and the load.

    F = m·(ω²·c + 2·ζ·ω·ḋ·r(c)) while in contact, never pulling back through the gap;   d̈ = −F/m − a

d: how far the load is ahead of the rod; c = d ∓ g/2 beyond the gap g, 0 within it; ω = 2π·f of the contact. Damping
grows over the first twentieth of the gap (r), so that contact is continuous. The mass m comes on top of moving_mass;
without it (m = 0) nothing is felt.

Source: Nordin & Gutman (2002), Automatica 38(10), dead-zone model of backlash; Hunt & Crossley (1975), J. Applied
Mechanics 42, for damping that vanishes at first touch.
"""

import math

from numba import njit

from hydraulic_sim.effect import Effect, Parameter, State

TOUCH = 0.05  # of the gap: depth of contact over which damping grows


@njit(error_model="numpy")
def contact(lead, lead_rate, gap, frequency, damping):
    """Acceleration of the rod's pull on the load [m/s²], against the load's lead."""
    w = 2.0 * math.pi * frequency
    depth = abs(lead) - 0.5 * gap
    if depth <= 0.0:
        return 0.0
    side = 1.0 if lead > 0.0 else -1.0
    touch = TOUCH * gap
    grown = depth / touch if depth < touch else 1.0
    return side * max(w * w * depth + 2.0 * damping * w * grown * side * lead_rate, 0.0)


def force(lead, lead_rate, mass, gap, frequency, damping):
    return mass * contact(lead, lead_rate, gap, frequency, damping)


def dynamics(lead, lead_rate, acceleration, gap, frequency, damping):
    return lead_rate, -contact(lead, lead_rate, gap, frequency, damping) - acceleration


def rate(p):
    """Six times that of both masses on the contact, as every touch bends the trajectory."""
    both = (1.0 + p["mass"] / p["moving_mass"]) ** 0.5
    return 12.0 * math.pi * p["frequency"] * both * max(1.0, p["damping"] * both) if p["mass"] > 0.0 else 0.0


EFFECT = Effect(
    slot="force",
    summary="a gap between rod and load",
    kernel=force,
    dynamics=dynamics,
    states=(State("lead", "m", scale=1e-3), State("lead_rate", "m/s", scale=0.1)),
    parameters=(
        Parameter("mass", "kg", 200.0, (0.0, 1e6), "mass behind the gap, on top of moving_mass",
                  "part of the paper's load", null=0.0),
        Parameter("gap", "m", 1e-3, (0.0, 0.05), "total width of the gap", "worn rod eyes: 0.1 to 2 mm"),
        Parameter("frequency", "Hz", 50.0, (5.0, 300.0), "natural frequency of the load on the contact, rod held",
                  "steel contact of a rod eye, softened by its bearing"),
        Parameter("damping", "1", 0.1, (0.0, 2.0), "damping ratio in contact", "steel on steel with grease"),
    ),
    equation="F = m*(w^2*c + 2*zeta*w*d'), c = d -/+ g/2 beyond the gap",
    source="Nordin & Gutman (2002), Automatica 38(10)",
    excited_by="reversals, slow and fast",
    confused_with=("valve_hysteresis", "valve_deadband", "presliding"),
    alike_without_pressures="sticking",
    distinguished_by="a width that does not depend on speed",
    step_rate=rate,
    wear="rod eyes, pins, bearings",
)
