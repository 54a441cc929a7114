"""Sensor lag: the position sensor follows with a first-order delay.

    τ·dy/dt + y = x      (exact for motion that is straight between samples)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (LVDT demodulator).
"""

import math

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import begun


def follow(reading, memory, dt, velocity, time):
    if time <= 0.0:
        return reading
    if memory[0] <= 0.0:
        begin = reading - velocity * time  # as if it had always moved like this
        if memory[0] < 0.0:
            begin = begun(begin, time * time, memory)
        memory[0] = 1.0
        memory[1] = begin
        memory[2] = reading
        return begin
    slope = (reading - memory[2]) / dt
    fade = math.exp(-dt / time)
    memory[1] = reading - slope * time + (memory[1] - memory[2] + slope * time) * fade
    memory[2] = reading
    return memory[1]


EFFECT = Effect(
    slot="position_sensor",
    summary="first-order lag of the position sensor",
    kernel=follow,
    memory=3,
    parameters=(
        Parameter("time", "s", 3e-3, (0.0, 0.2), "time constant tau", "LVDT demodulators: 30 to 500 Hz", null=0.0),
    ),
    equation="tau*dy/dt + y = x",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="chirp and steps",
    confused_with=("spool_dynamics", "sensor_delay", "command_delay"),
    alike_without_pressures="lag",
    distinguished_by="the pressures lead the position",
    order=50,
    begins_shown=True,
)
