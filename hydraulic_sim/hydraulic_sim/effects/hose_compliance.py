"""Hose compliance: the walls of hoses and lines give way.

    C = C_h beside V/β in each chamber

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 3 (effective bulk modulus with container compliance).
"""

from hydraulic_sim.effect import Effect, Parameter


def compliance(capacity):
    return capacity, capacity


EFFECT = Effect(
    slot="compliance",
    summary="hoses and lines that give way",
    kernel=compliance,
    parameters=(
        Parameter("capacity", "m^3/Pa", 5e-13, (0.0, 1e-9), "volume gained per pressure, each side",
                  "2 m of 3/4 inch hose at a wall modulus of 0.7 GPa and its content", null=0.0),
    ),
    equation="C = V/beta + Ch",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 3",
    excited_by="chirp through the hydraulic resonance at several positions",
    confused_with=("entrained_air", "structural_flexibility"),
    distinguished_by="does not depend on pressure",
)
