"""A factor on the valve's opening of any shape.

o = s*(1 + height*hat(z))
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("position", "time", "pressure_difference", "velocity")
RETURNS = "opening * (1.0 + law)"


def add(position, t, pressure_difference, velocity, opening, over, centre, width, height, period):
    z = (position, t % period, pressure_difference, velocity)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    return opening * (1.0 + height * hat) if hat > 0.0 else opening


EFFECT = effect("opening", add, "1", size=0.02, most=1.0, order=96)
