"""Position loop: the actuator has a proportional position controller of its own; its command is a position.

    demand = min(max(g·K·(r − x), −1), 1),   r: the commanded position [m]

The drive of the record is that command: 1 V stands for 1 m (or for 1 rad of a rotary axis, which is described at a
radius of 1 m). K is the gain in the units of the firmware, which a record may state; with it, g is the same for all.
A loop that is not active (torque switched off) demands nothing.

Source: Franklin, Powell & Emami-Naeini (2014), Feedback Control of Dynamic Systems, ch. 4 (proportional control).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import clamp


def demand(command, drive_limit, position, gain, firmware_gain, active):
    if gain == 0.0:
        return command
    if active == 0.0:
        return 0.0
    return clamp(gain * firmware_gain * (command * drive_limit - position), -1.0, 1.0)


def rate(p):
    """Of a motor's mass on the loop as a spring."""
    return (p["gain"] * p["firmware_gain"] * abs(p["drive_force"]) * p["drive_limit"] / p["moving_mass"]) ** 0.5


EFFECT = Effect(
    slot="loop",
    summary="a position controller inside the actuator; the command is a position",
    kernel=demand,
    parameters=(
        Parameter("gain", "1/m", 20.0, (0.0, 1e6), "demand of full drive per position error, for a firmware gain of 1",
                  "data sheet of the servo", null=0.0),
        Parameter("firmware_gain", "1", 1.0, (0.0, 1e6), "gain K that is set in the firmware", "settings of the servo",
                  free=False),
        Parameter("active", "1", 1.0, (0.0, 1.0), "1: switched on, 0: switched off", "settings of the servo",
                  free=False),
    ),
    equation="demand = min(max(g*K*(r - x), -1), 1)",
    source="Franklin, Powell & Emami-Naeini (2014), Feedback Control of Dynamic Systems, ch. 4",
    excited_by="any motion",
    confused_with=("load_spring",),
    distinguished_by="the force vanishes where the actuator is where it was told to be",
    step_rate=rate,
    searched=False,
)  # fmt: skip
