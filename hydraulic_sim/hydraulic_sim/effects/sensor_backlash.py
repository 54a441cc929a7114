"""Sensor backlash: play in the linkage of the position sensor.

    y_k = min(max(y_{k−1}, x_k − g), x_k + g)

Source: Visintin (1994), Differential Models of Hysteresis, ch. III (play operator).
"""

import math

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import play


def lag_behind(reading, memory, velocity, half_gap):
    if memory[0] == 0.0:  # on the side where the motion presses it, or with what it showed
        memory[1] = reading - math.copysign(half_gap, velocity) if velocity != 0.0 else reading
    memory[0] = 1.0
    memory[1] = play(reading, half_gap, memory[1])
    return memory[1]


EFFECT = Effect(
    slot="position_sensor",
    summary="play in the position sensor's linkage",
    kernel=lag_behind,
    memory=3,
    parameters=(
        Parameter("half_gap", "m", 2e-4, (0.0, 0.02), "half the play", "ball joints of a sensor rod: 0.05 to 0.5 mm",
                  null=0.0),
    ),
    equation="y_k = min(max(y_{k-1}, x_k - g), x_k + g)",
    source="Visintin (1994), Differential Models of Hysteresis, ch. III",
    excited_by="slow reversals",
    confused_with=("backlash", "valve_hysteresis"),
    distinguished_by="the pressures show motion that the position does not",
    order=1,
    begins_shown=True,
)
