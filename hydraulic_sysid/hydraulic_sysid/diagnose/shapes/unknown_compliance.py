"""A capacity of any shape of both chambers.

    C = height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sim.effect import Effect, Parameter

VARIABLES = ("mean_pressure", "position", "time")


def add(pressure_a, pressure_b, position, t, over, centre, width, height):
    z = 0.5 * (pressure_a + pressure_b)
    if over == 1.0:
        z = position
    elif over == 2.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    c = height * part if part > 0.0 else 0.0
    return c, c


EFFECT = Effect(
    slot="compliance",
    summary="a capacity of both chambers of any shape",
    kernel=add,
    parameters=(
        Parameter("height", "m^3/Pa", 1e-13, (-1e-6, 1e-6), "height of the triangle", "shape of a residual", null=0.0),
        Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", "shape of a residual", free=False),
        Parameter(
            "centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", "shape of a residual", free=False
        ),
        Parameter(
            "width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", "shape of a residual", free=False
        ),
    ),
    equation="C = height*hat(z)",
    source="de Boor (1978), A Practical Guide to Splines, ch. III",
    excited_by="whatever moves the variable",
    confused_with=(),
    told_apart_by="the variable over which the curve explains most",
    order=90,
)
