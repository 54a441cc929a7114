"""An error of the pressure transducers of any shape: of either one over its own reading, or of both over time.

    y = p + height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z, and with it the transducer, by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sim.effect import Effect, Parameter

VARIABLES = ("pressure_a", "pressure_b", "time")


def add(reading_a, reading_b, t, over, centre, width, height):
    z = reading_a
    if over == 1.0:
        z = reading_b
    elif over == 2.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    error = height * part if part > 0.0 else 0.0
    a = error if over != 1.0 else 0.0
    b = error if over != 0.0 else 0.0
    return reading_a + a, reading_b + b


EFFECT = Effect(
    slot="pressure_sensor",
    summary="an error of the pressure transducers of any shape",
    kernel=add,
    parameters=(
        Parameter("height", "Pa", 1e4, (-1e9, 1e9), "height of the triangle", "shape of a residual", null=0.0),
        Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", "shape of a residual", free=False),
        Parameter(
            "centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", "shape of a residual", free=False
        ),
        Parameter(
            "width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", "shape of a residual", free=False
        ),
    ),
    equation="y = p + height*hat(z)",
    source="de Boor (1978), A Practical Guide to Splines, ch. III",
    excited_by="whatever moves the variable",
    confused_with=(),
    told_apart_by="the variable over which the curve explains most",
    order=96,
)
