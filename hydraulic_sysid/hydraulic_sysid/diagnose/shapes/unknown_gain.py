"""A factor of any shape on the valve's opening.

    o = s*(1 + height*hat(z))

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sim.effect import Effect, Parameter

VARIABLES = ("position", "time", "load_pressure", "velocity")


def add(position, t, load_pressure, velocity, opening, over, centre, width, height):
    z = position
    if over == 1.0:
        z = t
    elif over == 2.0:
        z = load_pressure
    elif over == 3.0:
        z = velocity
    part = 1.0 - abs(z - centre) / width
    return opening * (1.0 + height * part) if part > 0.0 else opening


EFFECT = Effect(
    slot="opening",
    summary="a factor on the valve's opening of any shape",
    kernel=add,
    parameters=(
        Parameter("height", "1", 0.02, (-1.0, 1.0), "height of the triangle", "shape of a residual", null=0.0),
        Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", "shape of a residual", free=False),
        Parameter(
            "centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", "shape of a residual", free=False
        ),
        Parameter(
            "width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", "shape of a residual", free=False
        ),
    ),
    equation="o = s*(1 + height*hat(z))",
    source="de Boor (1978), A Practical Guide to Splines, ch. III",
    excited_by="whatever moves the variable",
    confused_with=(),
    told_apart_by="the variable over which the curve explains most",
    order=96,
)
