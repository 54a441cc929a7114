"""Load-dependent friction: teeth and screws rub in proportion to the force that they transmit.

    F = −c·|F_act|·z      (F_act: force of the actuator; z: direction of sliding, −1…1)

Source: Armstrong-Hélouvry, Dupont & Canudas de Wit (1994), Automatica 30(7), sec. 2 (friction and normal load);
Duclusaud et al. (2024), Extended friction models for the physics simulation of servo actuators.
"""

from hydraulic_sim.base import dry_friction_rate
from hydraulic_sim.effect import Effect, Parameter


def force(actuator_force, direction, coefficient):
    return -coefficient * abs(actuator_force) * direction


EFFECT = Effect(
    slot="force",
    summary="dry friction that grows with the transmitted force",
    kernel=force,
    parameters=(
        Parameter("coefficient", "1", 0.1, (0.0, 0.95), "friction over transmitted force",
                  "Duclusaud et al. (2024): gears of small servos 0.05 to 0.5", null=0.0),
    ),
    equation="F = -c*|F_act|*sign(v)",
    source="Armstrong-Helouvry, Dupont & Canudas de Wit (1994), Automatica 30(7); Duclusaud et al. (2024)",
    excited_by="slow motion under small and large loads",
    confused_with=("coulomb_friction", "friction_asymmetry"),
    distinguished_by="the same motion with and without a load",
    step_rate=lambda p: dry_friction_rate(p["coefficient"] * p["drive_force"] * p["drive_limit"], p),
    wear="teeth of the gear",
    kinds=("mechanical",),
)  # fmt: skip
