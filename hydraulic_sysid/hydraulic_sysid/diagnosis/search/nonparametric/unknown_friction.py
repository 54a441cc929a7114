"""Dry friction of any shape.

    F = -height*hat(z)*direction

Against the motion, at rest as at speed.
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("position", "speed", "size_of_pressure_difference", "mean_pressure", "time")
RETURNS = "-law * direction"


def add(
    position, velocity, pressure_difference, pressure_a, pressure_b, t, direction,
    over, centre, width, height, period,
):
    z = (position, abs(velocity), abs(pressure_difference), 0.5 * (pressure_a + pressure_b), t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    return -height * hat * direction if hat > 0.0 else 0.0


EFFECT = effect("force", add, "N", size=100.0, most=1e7, order=90)
