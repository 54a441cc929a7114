"""Sensor quantisation: the position comes in steps.

    y = q·round(x/q)

or, with noise of standard deviation σ before the converter, its mean over that noise, which has lost its corners:

    y = q·Σ_k Φ((x − (k + ½)·q)/σ)

Source: Widrow & Kollár (2008), Quantization Noise, ch. 1, and ch. 19 on noise as a dither.
"""

import math

from hydraulic_sim.effect import Effect, Parameter

EVEN = 0.8  # steps of noise from which nothing is left of them: 3e-6 of a step
REACH = 4  # steps to either side whose edges noise of up to that reaches
ROOT_2 = math.sqrt(2.0)


def round_off(reading, step, noise):
    if step <= 0.0 or noise > EVEN * step:
        return reading
    nearest = math.floor(reading / step + 0.5)
    if noise <= 0.0:
        return step * nearest
    passed = 0.0
    for i in range(2 * REACH):
        beyond = reading - (nearest - REACH + i + 0.5) * step
        passed += 0.5 * math.erfc(-beyond / (noise * ROOT_2))
    return step * (nearest - REACH + passed)


EFFECT = Effect(
    slot="position_sensor",
    summary="position in steps of the converter",
    kernel=round_off,
    parameters=(
        Parameter("step", "m", 2.4e-5, (0.0, 0.01), "least significant bit", "16 bit over 1.5 m", null=0.0,
                  free=False, observed="resolution"),
        Parameter("noise", "m", 0.0, (0.0, 0.01), "noise before the converter; more than 0: the reading is its mean",
                  "a simulation adds noise itself", free=False, observed="blur"),
    ),
    equation="y = q*round(x/q), or its mean over noise",
    source="Widrow & Kollar (2008), Quantization Noise, ch. 1 and 19",
    excited_by="any slow motion",
    confused_with=("sensor_backlash",),
    distinguished_by="histogram of the readings",
    order=90,
)
