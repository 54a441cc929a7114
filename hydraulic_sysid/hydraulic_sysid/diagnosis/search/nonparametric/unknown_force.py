"""A force of any shape.

F = -height*hat(z)
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("velocity", "position", "pressure_difference", "mean_pressure", "opening", "time")
RETURNS = "-law"


def add(
    velocity, position, pressure_difference, pressure_a, pressure_b, opening, t,
    over, centre, width, height, period,
):
    z = (velocity, position, pressure_difference, 0.5 * (pressure_a + pressure_b), opening, t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    return -height * hat if hat > 0.0 else 0.0


EFFECT = effect("force", add, "N", size=100.0, most=1e7, order=90)
