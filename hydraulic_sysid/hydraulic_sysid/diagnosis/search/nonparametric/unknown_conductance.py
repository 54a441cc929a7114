"""A leak across the piston of any shape.

q = height*hat(z)*(p_A - p_B), q_A = -q, q_B = q
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("position", "time", "speed", "size_of_pressure_difference")
RETURNS = "-law * pressure_difference, law * pressure_difference"


def add(position, t, velocity, pressure_difference, over, centre, width, height, period):
    z = (position, t % period, abs(velocity), abs(pressure_difference))[int(over)]
    hat = 1.0 - abs(z - centre) / width
    q = height * hat * pressure_difference if hat > 0.0 else 0.0
    return -q, q


EFFECT = effect("flow", add, "m^3/(s*Pa)", size=1e-12, most=1.0, order=89, passive=True)
