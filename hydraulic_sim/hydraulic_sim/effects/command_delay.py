"""Command delay: dead time between the drive and the valve.

    s_d(t) = u(t − T)      (mean over each sample of the held drive)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (electronics and bus).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import delayed


def delay_command(command, memory, dt, delay):
    return delayed(command, delay, dt, memory)


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
)
