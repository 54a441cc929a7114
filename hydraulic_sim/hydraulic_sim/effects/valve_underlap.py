"""Valve underlap: around null all lands are open.

    o_PA = o_BT = max(δ + s, 0),   o_AT = o_PB = max(δ − s, 0)

Within |s| < δ the flow gain is doubled and oil flows through the centre.

Source: Merritt (1967), Hydraulic Control Systems, ch. 5 (open-centre valve).
"""

from hydraulic_sim.effect import Effect, Parameter


def lands(opening, width):
    forward = max(width + opening, 0.0)
    backward = max(width - opening, 0.0)
    return forward, backward, backward, forward


EFFECT = Effect(
    slot="lands",
    summary="all lands open around null",
    kernel=lands,
    parameters=(
        Parameter("width", "1", 0.02, (0.0, 0.3), "underlap of each land, of full opening",
                  "Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4: up to 5 %", null=0.0),
    ),
    equation="o_PA = o_BT = max(d + s, 0), o_AT = o_PB = max(d - s, 0)",
    source="Merritt (1967), Hydraulic Control Systems, ch. 5",
    excited_by="slow motion through null; pressure gain at blocked load",
    confused_with=("internal_leakage", "viscous_friction", "coulomb_friction"),
    distinguished_by="pressure gain at blocked load",
)
