"""Pressure offset: the zeros of the pressure transducers are off.

    y_A = p_A + a,   y_B = p_B + b

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (sensors).
"""

from hydraulic_sim.effect import Effect, Parameter


def shift(reading_a, reading_b, offset_a, offset_b):
    return reading_a + offset_a, reading_b + offset_b


EFFECT = Effect(
    slot="pressure_sensor",
    summary="zero errors of the pressure transducers",
    kernel=shift,
    parameters=(
        Parameter("offset_a", "Pa", 1e5, (-1e7, 1e7), "reading of transducer A at zero pressure",
                  "data sheets: up to 1 % of range", null=0.0),
        Parameter("offset_b", "Pa", 0.0, (-1e7, 1e7), "reading of transducer B at zero pressure",
                  "data sheets: up to 1 % of range", null=0.0),
    ),
    equation="y_A = p_A + a, y_B = p_B + b",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="rest with equal pressures",
    confused_with=("constant_load",),
    distinguished_by="equal pressures at rest",
    wear="pressure transducers",
)
