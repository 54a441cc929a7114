"""A leak across the piston whose conductance has any shape.

    q = height*hat(z)*(p_A - p_B), q_A = -q, q_B = q

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

VARIABLES = ("position", "time", "speed", "size_of_pressure_difference")


def add(position, t, velocity, pressure_difference, over, centre, width, height):
    z = position
    if over == 1.0:
        z = t
    elif over == 2.0:
        z = abs(velocity)
    elif over == 3.0:
        z = abs(pressure_difference)
    part = 1.0 - abs(z - centre) / width
    q = height * part * pressure_difference if part > 0.0 else 0.0
    return -q, q


EFFECT = curve(
    slot="flow",
    summary="a leak across the piston of any shape",
    kernel=add,
    unit="m^3/(s*Pa)",
    size=1e-12,
    bounds=(-1.0, 1.0),
    equation="q = height*hat(z)*(p_A - p_B), q_A = -q, q_B = q",
    order=89,
)
