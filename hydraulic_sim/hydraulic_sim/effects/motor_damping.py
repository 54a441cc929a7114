"""Motor damping: the back electromotive force of a voltage-driven motor brakes it while it is switched on.

    F = −b·v,   b = k²/R at the output      (k: force constant, R: resistance of the winding)

Unlike friction it is gone when the bridge is open (`active` 0).

Source: Franklin, Powell & Emami-Naeini (2014), Feedback Control of Dynamic Systems, ch. 2 (DC motor).
"""

from hydraulic_sim.effect import Effect, Parameter


def force(velocity, coefficient, active):
    return -coefficient * active * velocity


EFFECT = Effect(
    slot="force",
    summary="back electromotive force of a motor that is switched on",
    kernel=force,
    parameters=(
        Parameter("coefficient", "N*s/m", 0.1, (0.0, 1e6), "damping b = k^2/R", "motor data sheet", null=0.0),
        Parameter("active", "1", 1.0, (0.0, 1.0), "1: switched on, 0: switched off", "settings of the servo",
                  free=False),
    ),
    equation="F = -b*v while switched on",
    source="Franklin, Powell & Emami-Naeini (2014), Feedback Control of Dynamic Systems, ch. 2",
    excited_by="fast motion, switched on and off",
    confused_with=("viscous_friction",),
    alike_without_pressures="damping",
    distinguished_by="motion with the motor switched off",
    step_rate=lambda p: p["coefficient"] / p["moving_mass"],
    kinds=("mechanical",),
)  # fmt: skip
