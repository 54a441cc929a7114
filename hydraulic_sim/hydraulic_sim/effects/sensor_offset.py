"""Sensor offset: the position sensor's zero is off.

    y = x + a

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (sensors).
"""

from hydraulic_sim.effect import Effect, Parameter


def shift(reading, offset):
    return reading + offset


EFFECT = Effect(
    slot="position_sensor",
    summary="zero error of the position sensor",
    kernel=shift,
    parameters=(
        Parameter("offset", "m", 5e-3, (-1.0, 1.0), "reading at true zero", "mounting of an LVDT: millimetres",
                  null=0.0),
    ),
    equation="y = x + a",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="the end stops",
    confused_with=("valve_null_bias", "constant_load"),
    alike_without_pressures="offset",
    distinguished_by="end stops",
    order=40,
)
