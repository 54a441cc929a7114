"""Valve null bias: the valve is not shut at zero drive.

    o = s + b

Source: Merritt (1967), Hydraulic Control Systems, ch. 5 (null shift).
"""

from hydraulic_sim.effect import Effect, Parameter


def shift(opening, bias):
    return opening + bias


EFFECT = Effect(
    slot="opening",
    summary="the valve is open a little at zero drive",
    kernel=shift,
    parameters=(
        Parameter("bias", "1", 0.02, (-0.3, 0.3), "opening at zero drive, of full opening",
                  "servo valve data sheets: null bias up to 3 %", null=0.0),
    ),
    equation="o = s + b",
    source="Merritt (1967), Hydraulic Control Systems, ch. 5",
    excited_by="rest at zero drive",
    confused_with=("constant_load", "sensor_offset", "friction_asymmetry"),
    alike_without_pressures="offset",
    distinguished_by="load pressure at rest",
    order=10,
    wear="null of the valve's first stage",
)
