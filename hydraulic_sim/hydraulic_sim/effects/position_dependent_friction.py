"""Position-dependent friction: dry friction grows towards the ends of the stroke.

    F = −g·x²·z      (z: direction of sliding; with Coulomb friction Fc: Fc·(1 + a·x²), g = a·Fc)

Source: Armstrong-Hélouvry, Dupont & Canudas de Wit (1994), Automatica 30(7), sec. on friction phenomena.
"""

from hydraulic_sim.base import dry_friction_rate
from hydraulic_sim.effect import Effect, Parameter


def force(position, direction, growth):
    return -growth * position * position * direction


EFFECT = Effect(
    slot="force",
    summary="dry friction that changes along the stroke",
    kernel=force,
    parameters=(
        Parameter("growth", "N/m^2", 800.0, (0.0, 1e8),
                  "growth of the friction level with the square of the position",
                  "doubles the paper's 450 N at the stops of a 1.5 m stroke", null=0.0),
    ),
    equation="F = -g*x^2*sign(v)",
    source="Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30(7)",
    excited_by="the same speed at different positions",
    confused_with=("end_cushion", "load_spring", "coulomb_friction"),
    distinguished_by="same speed at different positions; changes sign with the direction",
    step_rate=lambda p: dry_friction_rate(p["growth"] * (0.5 * p["stroke"]) ** 2, p),
)
