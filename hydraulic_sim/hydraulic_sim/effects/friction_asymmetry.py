"""Friction asymmetry: dry friction differs between extending and retracting.

    F = −ΔF·|z|,   so that Fc₊ = Fc + ΔF and Fc₋ = Fc − ΔF      (z: direction of sliding, −1…1)

Unlike a load it vanishes at rest. It only takes energy together with a Coulomb friction of at least |ΔF|.

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (asymmetric friction).
"""

from hydraulic_sim.base import dry_friction_rate
from hydraulic_sim.effect import Effect, Parameter


def force(direction, difference):
    return -difference * abs(direction)


EFFECT = Effect(
    slot="force",
    summary="dry friction that differs by direction",
    kernel=force,
    parameters=(
        Parameter("difference", "N", 100.0, (-1e5, 1e5), "half the difference of the friction levels by direction",
                  "a fifth of the dry friction of the paper's actuator", null=0.0),
    ),
    equation="F = -dF*|sign(v)|",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="reversals at several loads, with rests between",
    confused_with=("constant_load", "viscous_asymmetry", "valve_null_bias"),
    distinguished_by="reversal at several loads; vanishes at rest",
    step_rate=lambda p: dry_friction_rate(p["difference"], p),
)
