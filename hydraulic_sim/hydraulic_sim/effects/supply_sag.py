"""Supply sag: the voltage of an electric supply falls with the current that the motor draws.

    e' = e/(1 + r·|e|),   r = R_supply/R_winding

Source: Hughes & Drury (2019), Electric Motors and Drives, 5th ed., ch. 3 (motor on a supply with resistance).
"""

from hydraulic_sim.effect import Effect, Parameter


def sag(effort, ratio):
    return effort / (1.0 + ratio * abs(effort))


EFFECT = Effect(
    slot="motor",
    summary="supply voltage that falls under load",
    kernel=sag,
    parameters=(
        Parameter("ratio", "1", 0.5, (0.0, 5.0), "resistance of supply and wires over that of the winding",
                  "long thin wires, small power supplies: 0.1 to 1", null=0.0),
    ),
    equation="e' = e/(1 + r*|e|)",
    source="Hughes & Drury (2019), Electric Motors and Drives, ch. 3",
    excited_by="large and small efforts at standstill under load",
    confused_with=("force_limit", "load_dependent_friction"),
    distinguished_by="full and half effort against the same spring or weight",
    order=10,
    kinds=("mechanical",),
)  # fmt: skip
