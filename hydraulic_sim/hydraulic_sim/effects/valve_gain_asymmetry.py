"""Valve gain asymmetry: the valve opens wider to one side.

    o = (1 + a)·s for s > 0,  (1 − a)·s for s < 0

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (valve symmetry).
"""

from hydraulic_sim.effect import Effect, Parameter


def scale(opening, asymmetry):
    return opening + asymmetry * abs(opening)


EFFECT = Effect(
    slot="opening",
    summary="flow gain that differs by direction",
    kernel=scale,
    parameters=(
        Parameter("asymmetry", "1", 0.05, (-0.6, 0.6), "relative difference of each side's gain from the mean",
                  "servo valve data sheets: symmetry within 10 %", null=0.0),
    ),
    equation="o = (1 +/- a)*s",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="extending and retracting at equal load pressure",
    confused_with=("valve_null_bias", "viscous_asymmetry", "constant_load"),
    distinguished_by="extend and retract speed at equal load pressure",
    order=40,
)
