"""A dry friction of any shape: against the motion, at rest as at speed.

    F = -height*hat(z)*direction

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("position", "speed", "size_of_pressure_difference", "mean_pressure", "time")


def add(position, velocity, pressure_difference, pressure_a, pressure_b, t, direction, over, centre, width, height):
    z = position
    if over == 1.0:
        z = abs(velocity)
    elif over == 2.0:
        z = abs(pressure_difference)
    elif over == 3.0:
        z = 0.5 * (pressure_a + pressure_b)
    elif over == 4.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    return -height * part * direction if part > 0.0 else 0.0


EFFECT = curve(
    slot="force",
    summary="dry friction of any shape",
    kernel=add,
    unit="N",
    size=100.0,
    bounds=(-1e7, 1e7),
    equation="F = -height*hat(z)*direction",
    order=90,
)
