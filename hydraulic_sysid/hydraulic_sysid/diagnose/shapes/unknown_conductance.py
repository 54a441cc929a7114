"""A leak across the piston whose conductance has any shape.

    q = height*hat(z)*(p_A - p_B), q_A = -q, q_B = q

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sim.effect import Effect, Parameter

VARIABLES = ("position", "time", "speed", "size_of_load_pressure")


def add(position, t, velocity, load_pressure, over, centre, width, height):
    z = position
    if over == 1.0:
        z = t
    elif over == 2.0:
        z = abs(velocity)
    elif over == 3.0:
        z = abs(load_pressure)
    part = 1.0 - abs(z - centre) / width
    q = height * part * load_pressure if part > 0.0 else 0.0
    return -q, q


EFFECT = Effect(
    slot="flow",
    summary="a leak across the piston of any shape",
    kernel=add,
    parameters=(
        Parameter(
            "height", "m^3/(s*Pa)", 1e-12, (-1.0, 1.0), "height of the triangle", "shape of a residual", null=0.0
        ),
        Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", "shape of a residual", free=False),
        Parameter(
            "centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", "shape of a residual", free=False
        ),
        Parameter(
            "width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", "shape of a residual", free=False
        ),
    ),
    equation="q = height*hat(z)*(p_A - p_B), q_A = -q, q_B = q",
    source="de Boor (1978), A Practical Guide to Splines, ch. III",
    excited_by="whatever moves the variable",
    confused_with=(),
    told_apart_by="the variable over which the curve explains most",
    order=89,
)
