"""An addition to the valve's opening of any shape.

o = s + height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("opening", "velocity", "pressure_difference", "position", "time")
RETURNS = "opening + law"


def add(opening, velocity, pressure_difference, position, t, over, centre, width, height, period):
    z = (opening, velocity, pressure_difference, position, t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    return opening + height * hat if hat > 0.0 else opening


EFFECT = effect("opening", add, "1", size=0.002, most=1.0, order=95)
