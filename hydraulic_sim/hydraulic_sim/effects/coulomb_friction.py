"""Coulomb friction: a constant force against the motion, with a true stick at rest.

    F = −Fc·z      (z: direction of sliding, −1…1)

z follows the sign of the velocity within a few micrometres of sliding (dz/dt = |v|/δ·(sign v − z), Dahl), so that
the force is continuous and a piston at rest does not creep; `presliding` gives δ a physical size.

Source: Merritt (1967), Hydraulic Control Systems, ch. 6; Dahl (1968), A solid friction model.
"""

from hydraulic_sim.base import dry_friction_rate
from hydraulic_sim.effect import Effect, Parameter


def force(direction, level):
    return -level * direction


EFFECT = Effect(
    slot="force",
    summary="dry friction of constant size",
    kernel=force,
    parameters=(
        Parameter("level", "N", 450.0, (0.0, 1e5), "friction force Fc while sliding",
                  "Nisar & Munawar, table of parameters", null=0.0),
    ),
    equation="F = -Fc*sign(v), regularised over micrometres",
    source="Merritt (1967), Hydraulic Control Systems, ch. 6; Dahl (1968)",
    excited_by="slow triangle through standstill: the load pressure builds up while the piston sticks",
    confused_with=("valve_deadband", "backlash"),
    alike_without_pressures="sticking",
    distinguished_by="slow triangle: load pressure builds up while stuck",
    step_rate=lambda p: dry_friction_rate(p["level"], p),
    wear="seals and guides",
)
