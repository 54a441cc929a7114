"""Sensor delay: the position arrives late.

    y(t) = x(t − T)      (straight between samples)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (sensors and bus).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import begun, delayed


def delay_reading(reading, memory, dt, velocity, delay):
    if memory[0] <= 0.0:
        bend = 0.0  # as if it had always moved like this, or so that it shows what it showed
        if memory[0] < 0.0 and delay > 0.0:
            straight = reading - velocity * delay
            bend = (begun(straight, 0.5 * delay * delay, memory) - straight) / (delay * max(delay, dt))
        size = len(memory) - 1
        memory[0] = 1.0 * size
        for back in range(size):
            ago = back * dt
            memory[1 + (size - back) % size] = reading - velocity * ago + bend * ago * min(ago, delay)
    return delayed(reading, delay, dt, memory)


EFFECT = Effect(
    slot="position_sensor",
    summary="dead time of the position sensor",
    kernel=delay_reading,
    memory=258,
    parameters=(
        Parameter("delay", "s", 4e-3, (0.0, 0.2), "dead time T", "digital position sensors: 1 to 10 ms", null=0.0),
    ),
    equation="y(t) = x(t - T)",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="chirp and steps",
    confused_with=("command_delay", "sensor_lag", "spool_dynamics"),
    alike_without_pressures="lag",
    distinguished_by="the pressures lead the position, over frequency",
    order=60,
    reach=lambda p: p["delay"],
    begins_shown=True,
)
