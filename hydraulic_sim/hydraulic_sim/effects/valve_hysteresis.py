"""Valve hysteresis: the spool lags behind the drive by a play that does not depend on rate.

    s_k = min(max(s_{k−1}, u_k − h), u_k + h)

Source: Visintin (1994), Differential Models of Hysteresis, ch. III (play operator).
"""

from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.kernels import play


def lag_behind(command, memory, half_width):
    memory[0] = play(command, half_width, memory[0])
    return memory[0]


EFFECT = Effect(
    slot="command",
    summary="rate-independent play between drive and spool",
    kernel=lag_behind,
    memory=1,
    parameters=(
        Parameter("half_width", "1", 0.01, (0.0, 0.2), "half the width of the loop, of full opening",
                  "servo valve data sheets: hysteresis up to 3 % of rated drive", null=0.0),
    ),
    equation="s_k = min(max(s_{k-1}, u_k - h), u_k + h)",
    source="Visintin (1994), Differential Models of Hysteresis, ch. III",
    excited_by="small loops of drive at several amplitudes",
    confused_with=("backlash", "coulomb_friction", "valve_deadband", "presliding"),
    alike_without_pressures="sticking",
    distinguished_by="loop width over amplitude",
    order=20,
)
