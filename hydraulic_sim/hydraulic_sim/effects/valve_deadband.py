"""Valve dead band (overlap): the lands stay shut for small openings.

    o = 0 for |o| < δ,  o − δ·sign(o) beyond

Source: Merritt (1967), Hydraulic Control Systems, ch. 5 (overlapped centre).
"""

from hydraulic_sim.effect import Effect, Parameter


def opening(opening, width):
    if opening > width:
        return opening - width
    if opening < -width:
        return opening + width
    return 0.0


EFFECT = Effect(
    slot="opening",
    summary="no flow for small openings",
    kernel=opening,
    parameters=(
        Parameter("width", "1", 0.02, (0.0, 0.3), "overlap to each side, of full opening",
                  "Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4: up to 5 % and more", null=0.0),
    ),
    equation="o = 0 for |o| < d, else o - d*sign(o)",
    source="Merritt (1967), Hydraulic Control Systems, ch. 5",
    excited_by="slow triangle through null",
    confused_with=("coulomb_friction", "backlash"),
    alike_without_pressures="sticking",
    distinguished_by="the load pressure stays flat while the piston stands",
    order=20,
)
