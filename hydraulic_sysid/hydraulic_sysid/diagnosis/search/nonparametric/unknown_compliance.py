"""A capacity of both chambers of any shape.

C = height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("mean_pressure", "position", "time")
RETURNS = "law, law"


def add(pressure_a, pressure_b, position, t, over, centre, width, height, period):
    z = (0.5 * (pressure_a + pressure_b), position, t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    c = height * hat if hat > 0.0 else 0.0
    return c, c


EFFECT = effect("compliance", add, "m^3/Pa", size=1e-13, most=1e-6, order=90)
