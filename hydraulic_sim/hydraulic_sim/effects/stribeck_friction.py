"""Stribeck friction: dry friction rises towards standstill.

    F = −ΔF·exp(−(v/v_s)²)·z,   ΔF = Fs − Fc      (z: direction of sliding, −1…1)

Source: Armstrong-Hélouvry, Dupont & Canudas de Wit (1994), Automatica 30(7), eq. for the Stribeck curve.
"""

import math

from hydraulic_sim.base import dry_friction_rate
from hydraulic_sim.effect import Effect, Parameter


def force(velocity, direction, rise, speed):
    ratio = velocity / speed
    return -rise * math.exp(-ratio * ratio) * direction


EFFECT = Effect(
    slot="force",
    summary="dry friction that rises towards standstill",
    kernel=force,
    parameters=(
        Parameter("rise", "N", 200.0, (0.0, 1e5), "break-away friction above sliding friction, Fs - Fc",
                  "Jelali & Kroll (2003): Fs is 1.2 to 2 times Fc", null=0.0),
        Parameter("speed", "m/s", 0.01, (1e-4, 0.2), "Stribeck speed v_s", "hydraulic seals: 1 to 20 mm/s"),
    ),
    equation="F = -(Fs - Fc)*exp(-(v/vs)^2)*sign(v)",
    source="Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30(7)",
    excited_by="the lowest speeds, through standstill",
    confused_with=("coulomb_friction", "presliding"),
    alike_without_pressures="sticking",
    distinguished_by="the lowest speeds: friction falls as the speed rises",
    step_rate=lambda p: max(dry_friction_rate(p["rise"], p), 0.86 * p["rise"] / (p["speed"] * p["moving_mass"])),
)
