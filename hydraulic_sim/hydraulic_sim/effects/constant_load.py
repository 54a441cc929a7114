"""Constant load: gravity, tilt, a hanging weight.

    F = F_load      (positive extends)

Source: Merritt (1967), Hydraulic Control Systems, ch. 6 (load force).
"""

from hydraulic_sim.effect import Effect, Parameter


def force(load):
    return load


EFFECT = Effect(
    slot="force",
    summary="a force that does not change",
    kernel=force,
    parameters=(
        Parameter("load", "N", 500.0, (-1e6, 1e6), "load force; positive extends",
                  "a tenth of the weight of the paper's 500 kg", null=0.0),
    ),
    equation="F = F_load",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6",
    excited_by="rest at several positions",
    confused_with=("valve_null_bias", "pressure_offset", "friction_asymmetry"),
    alike_without_pressures="offset",
    distinguished_by="load pressure at rest, the same at several positions",
)
