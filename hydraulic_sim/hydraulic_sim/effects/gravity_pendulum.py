"""Gravity on an arm: a weight that hangs at an axis pulls it down.

    F = −T·sin(x − x0)      (x: angle, at a radius of 1 m; T = m·g·l)

Source: Goldstein, Poole & Safko (2002), Classical Mechanics, 3rd ed., ch. 1 (plane pendulum).
"""

import math

from hydraulic_sim.effect import Effect, Parameter


def force(position, weight, hanging):
    return -weight * math.sin(position - hanging)


EFFECT = Effect(
    slot="force",
    summary="weight of an arm that turns about a horizontal axis",
    kernel=force,
    parameters=(
        Parameter("weight", "N", 0.5, (0.0, 1e4), "moment m*g*l of the weight, at a radius of 1 m",
                  "mass and length of the arm", null=0.0),
        Parameter("hanging", "rad", 0.0, (-7.0, 7.0), "angle at which it hangs at rest",
                  "zero of the position sensor"),
    ),
    equation="F = -T*sin(x - x0)",
    source="Goldstein, Poole & Safko (2002), Classical Mechanics, ch. 1",
    excited_by="slow motion over a large angle, holding at several angles",
    confused_with=("load_spring", "constant_load"),
    distinguished_by="several angles over a quarter of a turn",
    kinds=("mechanical",),
)  # fmt: skip
