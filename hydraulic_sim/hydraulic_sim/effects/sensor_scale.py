"""Sensor scale: the position sensor's gain is off.

    y = c·x

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (sensors).
"""

from hydraulic_sim.effect import Effect, Parameter


def scale_reading(reading, scale):
    return scale * reading


EFFECT = Effect(
    slot="position_sensor",
    summary="gain error of the position sensor",
    kernel=scale_reading,
    parameters=(
        Parameter("scale", "1", 1.03, (0.2, 5.0), "reading over true position", "LVDT data sheets: within 1 to 3 %",
                  null=1.0),
    ),
    equation="y = c*x",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="large strokes between the end stops",
    confused_with=("sensor_nonlinearity", "valve_gain_curve"),
    distinguished_by="end stops and continuity: oil swallowed against motion read",
    order=30,
)
