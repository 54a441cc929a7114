"""Presliding: before it slides, dry friction yields like a spring of bristles.

    dz/dt = |v|/δ·(sign v − z),   F_dry = F(v)·(z + τ·dz/dt), never beyond F(v)

The bristles' stiffness is Fc/δ, their damping Fc·τ/δ (σ0 and σ1 of LuGre), which ends where friction is fully turned:
above δ/τ it follows the sign of the velocity. All dry friction of the model turns with z; at its null value δ is the
library's few micrometres, far below what position sensors resolve.

Source: Dahl (1968), A solid friction model; Canudas de Wit, Olsson, Åström & Lischinsky (1995),
IEEE Trans. Automatic Control 40(3).
"""

from hydraulic_sim.base import BRISTLE_LENGTH, BRISTLE_TIME
from hydraulic_sim.effect import Effect, Parameter


def bristle(length, time, bristle_length, bristle_time):
    if length <= bristle_length:
        return bristle_length, bristle_time
    return length, time


EFFECT = Effect(
    slot="bristle",
    summary="dry friction yields like a spring before it slides",
    kernel=bristle,
    parameters=(
        Parameter("length", "m", 5e-5, (BRISTLE_LENGTH, 5e-3), "sliding distance over which friction turns, delta",
                  "Armstrong-Helouvry et al. (1994): 2 to 50 um for metals, more for seals", null=BRISTLE_LENGTH),
        Parameter("time", "s", BRISTLE_TIME, (0.0, 0.1), "damping of the bristles over their stiffness, tau",
                  "near-critical damping of the paper's mass", null=BRISTLE_TIME),
    ),
    equation="dz/dt = |v|/d*(sign v - z); F = F_dry*(z + tau*dz/dt), never beyond F_dry",
    source="Canudas de Wit et al. (1995), IEEE Trans. Automatic Control 40(3); Dahl (1968)",
    excited_by="small reversals within and just beyond the bristles' length",
    confused_with=("backlash", "valve_hysteresis", "coulomb_friction"),
    distinguished_by="small reversals: friction turns over a distance, not at a speed",
)
