"""Force limit: firmware or amplifier limit the motor's current, and with it the force.

    |e'| ≤ s,   s: share of the force at full drive

Source: Hughes & Drury (2019), Electric Motors and Drives, 5th ed., ch. 4 (current limit of a drive).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import clamp


def limit(effort, share):
    return clamp(effort, -share, share)


EFFECT = Effect(
    slot="motor",
    summary="limited current of the motor",
    kernel=limit,
    parameters=(
        Parameter("share", "1", 0.5, (0.02, 1.0), "largest force, of that at full drive", "settings of the servo",
                  null=1.0),
    ),
    equation="|e'| <= s",
    source="Hughes & Drury (2019), Electric Motors and Drives, ch. 4",
    excited_by="large steps, heavy loads",
    confused_with=("supply_sag",),
    distinguished_by="efforts just below and far above the limit",
    order=20,
    kinds=("mechanical",),
)  # fmt: skip
