"""Sensor quantisation: the position comes in steps.

    y = q·round(x/q)

Source: Widrow & Kollár (2008), Quantization Noise, ch. 1.
"""

import math

from hydraulic_sim.effect import Effect, Parameter


def round_off(reading, step):
    if step <= 0.0:
        return reading
    return step * math.floor(reading / step + 0.5)


EFFECT = Effect(
    slot="position_sensor",
    summary="position in steps of the converter",
    kernel=round_off,
    parameters=(
        Parameter("step", "m", 2.4e-5, (0.0, 0.01), "least significant bit", "16 bit over 1.5 m", null=0.0,
                  free=False, observed="resolution"),
    ),
    equation="y = q*round(x/q)",
    source="Widrow & Kollar (2008), Quantization Noise, ch. 1",
    excited_by="any slow motion",
    confused_with=("sensor_backlash",),
    distinguished_by="histogram of the readings",
    order=90,
)
