"""Internal leakage: laminar flow past the piston, proportional to the pressure difference.

    q_A = −μ⁻¹·Ci·(p_A − p_B),   q_B = −q_A      (μ: the viscosity factor, 1 unless `viscosity_drift` is on)

Source: Merritt (1967), Hydraulic Control Systems, ch. 6.
"""

from hydraulic_sim.effect import Effect, Parameter


def flow(pressure_difference, viscosity, coefficient):
    q = coefficient * pressure_difference / viscosity
    return -q, q


EFFECT = Effect(
    slot="flow",
    summary="laminar flow past the piston",
    kernel=flow,
    parameters=(
        Parameter("coefficient", "m^3/(s*Pa)", 5e-13, (0.0, 1e-9), "leakage coefficient Ci",
                  "Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4: 1e-13 to 1e-11", null=0.0),
    ),
    equation="q = Ci*(p_A - p_B)",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6",
    excited_by="holding under load: the piston drifts in proportion to the pressure difference",
    confused_with=("viscous_friction", "valve_underlap"),
    alike_without_pressures="damping",
    distinguished_by="flow balance, not force balance",
    step_rate=lambda p: 2.0 * p["coefficient"] * p["bulk_modulus"] / min(p["dead_volume_a"], p["dead_volume_b"]),
    wear="piston seal",
)
