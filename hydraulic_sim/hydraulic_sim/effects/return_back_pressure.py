"""Return back pressure: the return line throttles the flow to the tank.

    dp_T/dt = (P_T + R·q_T·|q_T| − p_T)/τ      (τ: filling of the return line, milliseconds)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (return line).
"""

from hydraulic_sim.effect import Effect, Parameter, State


def tank(return_pressure):
    return return_pressure


def dynamics(flow_tank, tank_pressure, resistance, time):
    return 1.0 / time, tank_pressure + resistance * flow_tank * abs(flow_tank)


EFFECT = Effect(
    slot="tank",
    summary="return pressure that rises with flow",
    kernel=tank,
    dynamics=dynamics,
    states=(State("return_pressure", "Pa", initial="tank_pressure", kind="relaxation", scale=1e5),),
    parameters=(
        Parameter("resistance", "Pa*s^2/m^6", 3e11, (0.0, 1e15), "back pressure over the square of flow, R",
                  "0.3 MPa at 60 l/min", null=0.0),
        Parameter("time", "s", 5e-3, (1e-3, 1.0), "filling time of the return line", "a few metres of hose",
                  free=False),
    ),
    equation="pt = Pt + R*q*|q|, within the line's filling time",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="fast large strokes",
    confused_with=("supply_droop",),
    distinguished_by="pressure of the draining chamber",
    step_rate=lambda p: 2.0 * p["resistance"] * p["valve_flow"] ** 2 / p["valve_drop"] / p["time"],
)
