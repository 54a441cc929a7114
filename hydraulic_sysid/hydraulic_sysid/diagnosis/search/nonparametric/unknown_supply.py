"""A supply pressure of any shape.

p_S = p_0 + height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("size_of_opening", "velocity", "time", "pressure_difference")
RETURNS = "law"


def add(opening, velocity, t, pressure_difference, over, centre, width, height, period):
    z = (abs(opening), velocity, t % period, pressure_difference)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    return height * hat if hat > 0.0 else 0.0


EFFECT = effect("ripple", add, "Pa", size=100000.0, most=1e8, order=90)
