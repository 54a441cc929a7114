"""Load spring: a force proportional to position.

    F = −k·x

Source: Merritt (1967), Hydraulic Control Systems, ch. 6 (spring load, K).
"""

from hydraulic_sim.effect import Effect, Parameter


def force(position, stiffness):
    return -stiffness * position


EFFECT = Effect(
    slot="force",
    summary="a force proportional to position",
    kernel=force,
    parameters=(
        Parameter("stiffness", "N/m", 3000.0, (0.0, 1e9), "spring rate k", "a few kN at the stops of a 1.5 m stroke",
                  null=0.0),
    ),
    equation="F = -k*x",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6",
    excited_by="rest at several positions",
    confused_with=("internal_leakage", "valve_null_bias", "position_dependent_friction"),
    distinguished_by="static load pressure over position",
    step_rate=lambda p: (p["stiffness"] / p["moving_mass"]) ** 0.5,
)
