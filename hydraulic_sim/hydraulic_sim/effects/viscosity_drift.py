"""Viscosity drift: warming oil changes all viscous terms slowly.

    μ(t) = 1 + a·(1 − e^(−t/τ))

The factor multiplies viscous friction and divides laminar leakage.

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 3 (viscosity over temperature).
"""

import math

from hydraulic_sim.effect import Effect, Parameter


def drift(t, viscosity, change, time):
    return viscosity * (1.0 + change * (1.0 - math.exp(-t / time)))


EFFECT = Effect(
    slot="viscosity",
    summary="viscous terms that change as the oil warms",
    kernel=drift,
    parameters=(
        Parameter("change", "1", -0.3, (-0.9, 5.0), "relative change of the viscosity in the long run, a",
                  "mineral oil ISO VG 46 from 40 to 50 degC loses about 30 %", null=0.0),
        Parameter("time", "s", 60.0, (0.5, 1e5), "time constant tau", "heating of a small power pack: minutes"),
    ),
    equation="mu = 1 + a*(1 - exp(-t/tau))",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 3",
    excited_by="identical segments repeated over a long time",
    confused_with=("viscous_friction", "internal_leakage"),
    distinguished_by="identical segments repeated",
)
