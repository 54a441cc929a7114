"""A capacity of any shape of both chambers.

    C = height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("mean_pressure", "position", "time")


def add(pressure_a, pressure_b, position, t, over, centre, width, height):
    z = 0.5 * (pressure_a + pressure_b)
    if over == 1.0:
        z = position
    elif over == 2.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    c = height * part if part > 0.0 else 0.0
    return c, c


EFFECT = curve(
    slot="compliance",
    summary="a capacity of both chambers of any shape",
    kernel=add,
    unit="m^3/Pa",
    size=1e-13,
    bounds=(-1e-6, 1e-6),
    equation="C = height*hat(z)",
    order=90,
)
