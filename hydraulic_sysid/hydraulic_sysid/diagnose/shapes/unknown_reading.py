"""An error of the position sensor of any shape.

    y = x + height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sim.effect import Effect, Parameter

VARIABLES = ("position", "velocity", "time", "load_pressure")


def add(position, velocity, t, load_pressure, reading, over, centre, width, height):
    z = position
    if over == 1.0:
        z = velocity
    elif over == 2.0:
        z = t
    elif over == 3.0:
        z = load_pressure
    part = 1.0 - abs(z - centre) / width
    return reading + height * part if part > 0.0 else reading


EFFECT = Effect(
    slot="position_sensor",
    summary="an error of the position sensor of any shape",
    kernel=add,
    parameters=(
        Parameter("height", "m", 0.0001, (-1.0, 1.0), "height of the triangle", "shape of a residual", null=0.0),
        Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", "shape of a residual", free=False),
        Parameter(
            "centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", "shape of a residual", free=False
        ),
        Parameter(
            "width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", "shape of a residual", free=False
        ),
    ),
    equation="y = x + height*hat(z)",
    source="de Boor (1978), A Practical Guide to Splines, ch. III",
    excited_by="whatever moves the variable",
    confused_with=(),
    told_apart_by="the variable over which the curve explains most",
    order=95,
)
