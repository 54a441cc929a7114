"""Pump ripple: the pump's displacement elements beat on the supply pressure.

    Δp_S = P·sin(2π·f·t + φ)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (pump pulsation).
"""

import math

from hydraulic_sim.effect import Effect, Parameter


def ripple(t, amplitude, frequency, phase):
    return amplitude * math.sin(2.0 * math.pi * frequency * t + phase)


EFFECT = Effect(
    slot="ripple",
    summary="a sine on the supply pressure",
    kernel=ripple,
    parameters=(
        Parameter("amplitude", "Pa", 2e5, (0.0, 1e7), "amplitude of the ripple", "piston pumps: 1 to 5 % of pressure",
                  null=0.0),
        Parameter("frequency", "Hz", 200.0, (0.5, 500.0), "frequency of the ripple", "9 pistons at 1500 1/min: 225 Hz"),
        Parameter("phase", "rad", 0.0, (-7.0, 7.0), "phase at the start", "not known beforehand"),
    ),
    equation="dps = P*sin(2*pi*f*t + phi)",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="any opening held for a while",
    confused_with=("supply_droop",),
    distinguished_by="a line in the spectrum",
    step_rate=lambda p: 2.0 * math.pi * p["frequency"] if p["amplitude"] > 0.0 else 0.0,
)
