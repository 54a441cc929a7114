"""An addition of any shape to the valve's opening.

    o = s + height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("opening", "velocity", "pressure_difference", "position", "time")


def add(opening, velocity, pressure_difference, position, t, over, centre, width, height):
    z = opening
    if over == 1.0:
        z = velocity
    elif over == 2.0:
        z = pressure_difference
    elif over == 3.0:
        z = position
    elif over == 4.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    return opening + height * part if part > 0.0 else opening


EFFECT = curve(
    slot="opening",
    summary="an addition to the valve's opening of any shape",
    kernel=add,
    unit="1",
    size=0.002,
    bounds=(-1.0, 1.0),
    equation="o = s + height*hat(z)",
    order=95,
)
