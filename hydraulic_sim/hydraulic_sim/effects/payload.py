"""Payload: a mass that was put on and that moves with the piston.

    m = moving_mass + m_p

A record may state it, so that one model serves records with several loads.

Source: Newton's second law; Meriam & Kraige (2012), Engineering Mechanics: Dynamics, ch. 3.
"""

from hydraulic_sim.effect import Effect, Parameter


def mass(mass):
    return mass


EFFECT = Effect(
    slot="inertia",
    summary="mass of a load besides moving_mass",
    kernel=mass,
    parameters=(
        Parameter("mass", "kg", 1.0, (0.0, 1e6), "mass that was put on", "scales", null=0.0, free=False),
    ),
    equation="m = moving_mass + m_p",
    source="Meriam & Kraige (2012), Engineering Mechanics: Dynamics, ch. 3",
    excited_by="fast motion",
    confused_with=("structural_flexibility",),
    distinguished_by="fast motion with and without it",
    searched=False,
)  # fmt: skip
