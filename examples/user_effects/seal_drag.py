"""Seal drag: rod seals press harder under chamber pressure, and drag in proportion to it.

    F = −(c_A·p_A + c_B·p_B)·z      (z: direction of sliding, −1…1)

Source: Armstrong-Hélouvry, Dupont & Canudas de Wit (1994), Automatica 30(7), on load-dependent friction.
"""

from hydraulic_sim.effect import Effect, Parameter


def force(pressure_a, pressure_b, direction, drag_a, drag_b):
    return -(drag_a * max(pressure_a, 0.0) + drag_b * max(pressure_b, 0.0)) * direction


EFFECT = Effect(
    slot="force",
    summary="dry friction that grows with the chamber pressures",
    kernel=force,
    parameters=(
        Parameter("drag_a", "m^2", 2e-5, (0.0, 1e-3), "drag per pressure of chamber A", "seal catalogue", null=0.0),
        Parameter("drag_b", "m^2", 2e-5, (0.0, 1e-3), "drag per pressure of chamber B", "seal catalogue", null=0.0),
    ),
    equation="F = -(cA*pA + cB*pB)*sign(v)",
    source="Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30(7)",
    excited_by="slow motion at several mean pressures",
    confused_with=("coulomb_friction",),
    distinguished_by="friction force over p_A + p_B",
)
