"""Valve gain curve: flow grows progressively with the opening.

    o = s·(1 − c + c·|s|)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (progressive flow characteristic).
"""

from hydraulic_sim.effect import Effect, Parameter


def bend(opening, progression):
    return opening * (1.0 - progression + progression * abs(opening))


EFFECT = Effect(
    slot="opening",
    summary="progressive flow over opening",
    kernel=bend,
    parameters=(
        Parameter("progression", "1", 0.3, (-0.9, 0.95), "share of the quadratic part, c; negative: degressive",
                  "proportional valve data sheets: progressive spools", null=0.0),
    ),
    equation="o = s*(1 - c + c*|s|)",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="staircase of openings",
    confused_with=("valve_flow_saturation", "valve_deadband"),
    distinguished_by="staircase of openings",
    order=30,
)
