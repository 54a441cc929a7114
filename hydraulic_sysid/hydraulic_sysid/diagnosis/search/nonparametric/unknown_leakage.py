"""A flow across the piston of any shape.

q_A = -height*hat(z), q_B = height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("pressure_difference", "position", "velocity", "opening", "time")
RETURNS = "-law, law"


def add(pressure_difference, position, velocity, opening, t, over, centre, width, height, period):
    z = (pressure_difference, position, velocity, opening, t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    q = height * hat if hat > 0.0 else 0.0
    return -q, q


EFFECT = effect("flow", add, "m^3/s", size=1e-06, most=1.0, order=90)
