"""Viscous asymmetry: the viscous coefficient differs between extending and retracting.

    F = −μ·Δb·|v|,   so that b₊ = b + Δb and b₋ = b − Δb   (b: `viscous_friction`, μ: the viscosity factor)

It only takes energy together with a viscous friction of at least |Δb|.

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (asymmetric friction).
"""

from hydraulic_sim.effect import Effect, Parameter


def force(velocity, viscosity, difference):
    return -viscosity * difference * abs(velocity)


EFFECT = Effect(
    slot="force",
    summary="viscous friction that differs by direction",
    kernel=force,
    parameters=(
        Parameter("difference", "N*s/m", 50.0, (-1e5, 1e5), "half the difference of the coefficients by direction",
                  "a third of the viscous friction of the paper's actuator", null=0.0),
    ),
    equation="F = -db*|v|",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="strokes at several speeds in both directions",
    confused_with=("valve_gain_asymmetry", "friction_asymmetry", "constant_load"),
    distinguished_by="force balance by direction, growing with speed",
    step_rate=lambda p: abs(p["difference"]) / p["moving_mass"],
)
