"""An error of the pressure transducers of any shape: of either one over its own reading, or of both over time.

    y = p + height*hat(z)

hat(z) is 1 at ``centre`` and falls to 0 at ``width`` on both sides.
``over`` chooses z, and with it the transducer, by its place in VARIABLES.

Source: linear splines, de Boor (1978), A Practical Guide to Splines, ch. III.
"""

from hydraulic_sysid.diagnosis.search.shapes.triangle import curve

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


EFFECT = curve(
    slot="pressure_sensor",
    summary="an error of the pressure transducers of any shape",
    kernel=add,
    unit="Pa",
    size=1e4,
    bounds=(-1e9, 1e9),
    equation="y = p + height*hat(z)",
    order=96,
)
