"""Turbulent leakage: flow past the piston as through an orifice.

    q_A = −C·√|p_A − p_B|·sign(p_A − p_B),   q_B = −q_A      (finite slope at zero drop)

Source: Merritt (1967), Hydraulic Control Systems, ch. 3 (orifice flow).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import smooth_root_gain

TRANSITION = 1e4  # Pa, drop below which the leak turns laminar


def flow(pressure_difference, coefficient):
    q = coefficient * pressure_difference * smooth_root_gain(pressure_difference, TRANSITION)
    return -q, q


EFFECT = Effect(
    slot="flow",
    summary="orifice flow past the piston",
    kernel=flow,
    parameters=(
        Parameter("coefficient", "m^3/(s*Pa^0.5)", 5e-9, (0.0, 1e-5), "flow over the root of the drop",
                  "as much as the laminar leakage of a worn seal at 3 MPa", null=0.0),
    ),
    equation="q = C*sqrt(|PL|)*sign(PL)",
    source="Merritt (1967), Hydraulic Control Systems, ch. 3",
    excited_by="holding under several loads",
    confused_with=("internal_leakage",),
    distinguished_by="several loads: drift grows with the root of the load pressure",
    step_rate=lambda p: (
        2.0 * p["coefficient"] * p["bulk_modulus"] / (TRANSITION**0.5 * min(p["dead_volume_a"], p["dead_volume_b"]))
    ),
)
