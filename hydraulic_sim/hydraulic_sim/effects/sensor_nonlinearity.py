"""Sensor nonlinearity: the position sensor bends towards the ends.

    y = x + c·x³

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (sensors).
"""

from hydraulic_sim.effect import Effect, Parameter


def bend(reading, cubic):
    return reading + cubic * reading * reading * reading


EFFECT = Effect(
    slot="position_sensor",
    summary="cubic error of the position sensor",
    kernel=bend,
    parameters=(
        Parameter("cubic", "1/m^2", 0.05, (-1e3, 1e3), "cubic coefficient c",
                  "LVDT near the ends of its range: 1 to 3 %", null=0.0),
    ),
    equation="y = x + c*x^3",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="strokes over the whole travel",
    confused_with=("sensor_scale", "position_dependent_friction"),
    distinguished_by="continuity over position",
    order=20,
)
