"""A force on the piston of any shape.

    F = -height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("velocity", "position", "pressure_difference", "mean_pressure", "opening", "time")


def add(velocity, position, pressure_difference, pressure_a, pressure_b, opening, t, over, centre, width, height):
    z = velocity
    if over == 1.0:
        z = position
    elif over == 2.0:
        z = pressure_difference
    elif over == 3.0:
        z = 0.5 * (pressure_a + pressure_b)
    elif over == 4.0:
        z = opening
    elif over == 5.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    return -height * part if part > 0.0 else 0.0


EFFECT = curve(
    slot="force",
    summary="a force of any shape",
    kernel=add,
    unit="N",
    size=100.0,
    bounds=(-1e7, 1e7),
    equation="F = -height*hat(z)",
    order=90,
)
