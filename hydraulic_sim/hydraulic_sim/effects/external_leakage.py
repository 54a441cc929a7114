"""External leakage: each chamber loses oil to the outside, proportional to its pressure.

    q_A = −μ⁻¹·Ce·p_A,   q_B = −μ⁻¹·Ce·p_B      (μ: the viscosity factor)

Source: Merritt (1967), Hydraulic Control Systems, ch. 6 (C_ep).
"""

from hydraulic_sim.effect import Effect, Parameter


def flow(pressure_a, pressure_b, viscosity, coefficient):
    c = coefficient / viscosity
    return -c * pressure_a, -c * pressure_b


EFFECT = Effect(
    slot="flow",
    summary="oil lost from each chamber to the outside",
    kernel=flow,
    parameters=(
        Parameter("coefficient", "m^3/(s*Pa)", 5e-13, (0.0, 1e-9), "leakage coefficient Ce",
                  "Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4: of the order of the internal one",
                  null=0.0),
    ),
    equation="q = Ce*p per chamber",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6",
    excited_by="holding with both chambers under pressure",
    confused_with=("supply_droop", "valve_null_bias"),
    distinguished_by="common mode p_A + p_B",
    step_rate=lambda p: 2.0 * p["coefficient"] * p["bulk_modulus"] / min(p["dead_volume_a"], p["dead_volume_b"]),
    wear="rod seal, hoses, fittings",
)
