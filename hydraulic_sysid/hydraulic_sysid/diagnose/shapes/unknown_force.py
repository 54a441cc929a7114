"""A force on the piston of any shape.

    F = -height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sim.effect import Effect, Parameter

VARIABLES = ("velocity", "position", "load_pressure", "mean_pressure", "opening", "time")


def add(velocity, position, load_pressure, pressure_a, pressure_b, opening, t, over, centre, width, height):
    z = velocity
    if over == 1.0:
        z = position
    elif over == 2.0:
        z = load_pressure
    elif over == 3.0:
        z = 0.5 * (pressure_a + pressure_b)
    elif over == 4.0:
        z = opening
    elif over == 5.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    return -height * part if part > 0.0 else 0.0


EFFECT = Effect(
    slot="force",
    summary="a force of any shape",
    kernel=add,
    parameters=(
        Parameter("height", "N", 100.0, (-1e7, 1e7), "height of the triangle", "shape of a residual", null=0.0),
        Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", "shape of a residual", free=False),
        Parameter(
            "centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", "shape of a residual", free=False
        ),
        Parameter(
            "width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", "shape of a residual", free=False
        ),
    ),
    equation="F = -height*hat(z)",
    source="de Boor (1978), A Practical Guide to Splines, ch. III",
    excited_by="whatever moves the variable",
    confused_with=(),
    told_apart_by="the variable over which the curve explains most",
    order=90,
)
