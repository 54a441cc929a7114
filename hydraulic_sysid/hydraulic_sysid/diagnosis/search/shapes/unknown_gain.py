"""A factor of any shape on the valve's opening.

    o = s*(1 + height*hat(z))

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("position", "time", "pressure_difference", "velocity")


def add(position, t, pressure_difference, velocity, opening, over, centre, width, height):
    z = position
    if over == 1.0:
        z = t
    elif over == 2.0:
        z = pressure_difference
    elif over == 3.0:
        z = velocity
    part = 1.0 - abs(z - centre) / width
    return opening * (1.0 + height * part) if part > 0.0 else opening


EFFECT = curve(
    slot="opening",
    summary="a factor on the valve's opening of any shape",
    kernel=add,
    unit="1",
    size=0.02,
    bounds=(-1.0, 1.0),
    equation="o = s*(1 + height*hat(z))",
    order=96,
)
