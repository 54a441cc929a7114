"""An error of the position sensor of any shape.

    y = x + height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("position", "velocity", "time", "pressure_difference")


def add(position, velocity, t, pressure_difference, reading, over, centre, width, height):
    z = position
    if over == 1.0:
        z = velocity
    elif over == 2.0:
        z = t
    elif over == 3.0:
        z = pressure_difference
    part = 1.0 - abs(z - centre) / width
    return reading + height * part if part > 0.0 else reading


EFFECT = curve(
    slot="position_sensor",
    summary="an error of the position sensor of any shape",
    kernel=add,
    unit="m",
    size=0.0001,
    bounds=(-1.0, 1.0),
    equation="y = x + height*hat(z)",
    order=95,
)
