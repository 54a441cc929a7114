"""Command delay: dead time between the drive and the valve.

    s_d(t) = u(t − T)      (of the held drive, which then changes within a sample)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (electronics and bus).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import beyond_whole


def delay_command(command, memory, interval, into, delay):
    size = len(memory) - 1
    if into == 0.0:
        if memory[0] == 0.0:
            for i in range(size):
                memory[1 + i] = command
        memory[1 + int(memory[0]) % size] = command
        memory[0] += 1.0
    back = int(min(delay / interval + 1e-6, size - 2.0))
    if into == 0.0 and beyond_whole(delay, interval) > 0.0:
        back += 1
    return memory[1 + (int(memory[0]) - 1 - back + size) % size]


EFFECT = Effect(
    slot="command",
    summary="dead time between drive and valve",
    kernel=delay_command,
    memory=258,
    parameters=(
        Parameter("delay", "s", 4e-3, (0.0, 0.2), "dead time T", "bus and amplifier cycles: 1 to 20 ms", null=0.0),
    ),
    equation="s_d(t) = u(t - T)",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="steps and chirp: the pressures react late too",
    confused_with=("spool_dynamics", "sensor_delay", "sensor_lag"),
    alike_without_pressures="lag",
    distinguished_by="the pressures react late too; phase grows with frequency, amplitude does not fall",
    order=10,
    reach=lambda p: p["delay"],
    shift="delay",
)
