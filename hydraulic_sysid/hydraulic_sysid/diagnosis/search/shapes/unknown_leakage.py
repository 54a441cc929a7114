"""A flow of any shape from one chamber to the other.

    q_A = -height*hat(z), q_B = height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("pressure_difference", "position", "velocity", "opening", "time")


def add(pressure_difference, position, velocity, opening, t, over, centre, width, height):
    z = pressure_difference
    if over == 1.0:
        z = position
    elif over == 2.0:
        z = velocity
    elif over == 3.0:
        z = opening
    elif over == 4.0:
        z = t
    part = 1.0 - abs(z - centre) / width
    q = height * part if part > 0.0 else 0.0
    return -q, q


EFFECT = curve(
    slot="flow",
    summary="a flow across the piston of any shape",
    kernel=add,
    unit="m^3/s",
    size=1e-06,
    bounds=(-1.0, 1.0),
    equation="q_A = -height*hat(z), q_B = height*hat(z)",
    order=90,
)
