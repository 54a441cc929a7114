"""Supply droop: the supply pressure falls with the flow drawn, softened by an accumulator.

    dp_S/dt = (P_S − R·q_S − p_S)/τ      (τ = R·C of line and accumulator)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (power supply).
"""

from hydraulic_sim.effect import Effect, Parameter, State

SMALL_DROP = 1e5  # Pa over the lands, below which nobody sees how the flow drawn follows the supply pressure


def supply(line_pressure):
    return max(line_pressure, 0.0)


def dynamics(flow_supply, supply_pressure, resistance, time):
    return 1.0 / time, supply_pressure - resistance * flow_supply


EFFECT = Effect(
    slot="supply",
    summary="a supply that gives way under flow",
    kernel=supply,
    dynamics=dynamics,
    states=(State("line_pressure", "Pa", initial="supply_pressure", kind="relaxation", scale=1e6),),
    parameters=(
        Parameter("resistance", "Pa*s/m^3", 1e9, (0.0, 1e12), "drop of the supply per flow drawn, R",
                  "1 MPa at 60 l/min", null=0.0),
        Parameter("time", "s", 0.1, (1e-3, 100.0), "time constant tau", "small accumulator: 0.05 to 1 s"),
    ),
    equation="dps/dt = (Ps - R*q - ps)/tau",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="slow against fast large strokes",
    confused_with=("valve_flow_saturation", "return_back_pressure"),
    distinguished_by="slow against fast large strokes",
    # the flow drawn falls with the supply pressure, most at a small drop over the lands
    step_rate=lambda p: (
        p["resistance"] * p["valve_flow"] / p["time"]
        / (p["valve_drop"] * max(p["orifice_transition"], SMALL_DROP)) ** 0.5
    ),
)
