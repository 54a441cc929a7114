"""An error of the pressure transducers of any shape.

    y = p + height*hat(z)

Of either one over its own reading, or of both over time.
"""

from hydraulic_sysid.diagnosis.search.nonparametric.hat_function import effect

VARIABLES = ("pressure_a", "pressure_b", "time")
RETURNS = {
    "pressure_a": "reading_a + law, reading_b",
    "pressure_b": "reading_a, reading_b + law",
    "time": "reading_a + law, reading_b + law",
}
EXPRESSIONS = {"pressure_a": "reading_a", "pressure_b": "reading_b"}


def add(reading_a, reading_b, t, over, centre, width, height, period):
    z = (reading_a, reading_b, t % period)[int(over)]
    hat = 1.0 - abs(z - centre) / width
    error = height * hat if hat > 0.0 else 0.0
    a = error if over != 1.0 else 0.0
    b = error if over != 0.0 else 0.0
    return reading_a + a, reading_b + b


EFFECT = effect("pressure_sensor", add, "Pa", size=1e4, most=1e9, order=96)
