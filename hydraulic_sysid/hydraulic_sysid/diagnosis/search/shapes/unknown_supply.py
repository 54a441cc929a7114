"""A supply pressure of any shape.

    p_S = p_0 + height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("size_of_opening", "velocity", "time", "pressure_difference")


def add(opening, velocity, t, pressure_difference, over, centre, width, height):
    z = abs(opening)
    if over == 1.0:
        z = velocity
    elif over == 2.0:
        z = t
    elif over == 3.0:
        z = pressure_difference
    part = 1.0 - abs(z - centre) / width
    return height * part if part > 0.0 else 0.0


EFFECT = curve(
    slot="ripple",
    summary="a supply pressure of any shape",
    kernel=add,
    unit="Pa",
    size=100000.0,
    bounds=(-1e8, 1e8),
    equation="p_S = p_0 + height*hat(z)",
    order=90,
)
