"""An error of the position sensor of any shape.

y = x + height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("position", "velocity", "time", "pressure_difference")
RETURNS = "reading + law"


def add(position, velocity, t, pressure_difference, reading, over, centre, width, height, period):
    z = (position, velocity, t % period, pressure_difference)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    return reading + height * hat if hat > 0.0 else reading


EFFECT = effect("position_sensor", add, "m", size=0.0001, most=1.0, order=95)
