"""A flow out of both chambers of any shape.

q_A = q_B = -height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("mean_pressure", "position", "velocity", "opening", "time")
RETURNS = "-law, -law"


def add(pressure_a, pressure_b, position, velocity, opening, t, over, centre, width, height, period):
    z = (0.5 * (pressure_a + pressure_b), position, velocity, opening, t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    q = height * hat if hat > 0.0 else 0.0
    return -q, -q


EFFECT = effect("flow", add, "m^3/s", size=1e-06, most=1.0, order=90)
