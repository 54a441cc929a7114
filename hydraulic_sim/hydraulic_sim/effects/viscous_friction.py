"""Viscous friction: a force against the motion, proportional to speed.

    F = −μ·b·v      (μ: the viscosity factor, 1 unless `viscosity_drift` is on)

Source: Merritt (1967), Hydraulic Control Systems, ch. 6.
"""

from hydraulic_sim.effect import Effect, Parameter


def force(velocity, viscosity, coefficient):
    return -viscosity * coefficient * velocity


EFFECT = Effect(
    slot="force",
    summary="friction proportional to speed",
    kernel=force,
    parameters=(
        Parameter("coefficient", "N*s/m", 164.0, (0.0, 1e6), "viscous friction coefficient b",
                  "Nisar & Munawar, table of parameters: 64 and 100 N/(m/s) acting together", null=0.0),
    ),
    equation="F = -b*v",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6",
    excited_by="fast strokes at steady speed",
    confused_with=("internal_leakage",),
    alike_without_pressures="damping",
    distinguished_by="force balance, not flow balance",
    step_rate=lambda p: p["coefficient"] / p["moving_mass"],
    wear="the oil's viscosity, guides",
)
