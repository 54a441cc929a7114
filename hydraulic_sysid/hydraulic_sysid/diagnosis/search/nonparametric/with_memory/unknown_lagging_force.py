"""A force of any shape.

F = -height*hat(z), dz/dt = (v - z)/lag

It follows the velocity late.
"""

from hydraulic_sim.effect import Parameter, State
from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

FOLLOWS = "velocity"
VARIABLES = ("lagged_velocity",)
RETURNS = "-law"


def add(lagged_velocity, over, centre, width, height):
    hat = 1.0 - abs(lagged_velocity - centre) / width
    return -height * hat if hat > 0.0 else 0.0


def follow(velocity, lag):
    return 1.0 / lag, velocity


EFFECT = effect(
    "force", add, "N", size=100.0, most=1e7, order=90, dynamics=follow,
    states=(State("lagged_velocity", "m/s", kind="relaxation", scale=0.1),),
    shape=(Parameter("lag", "s", 0.01, (1e-5, 10.0), "time by which it follows", "curve of a residual", free=False),),
)  # fmt: skip
