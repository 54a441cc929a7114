"""Valve flow saturation: the opening is limited.

    o = min(max(s, −l), l)

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (flow saturation).
"""

from hydraulic_sim.effect import Effect, Parameter


def limit_opening(opening, limit):
    if limit >= 1.0:
        return opening
    return min(max(opening, -limit), limit)


EFFECT = Effect(
    slot="opening",
    summary="an opening that is limited",
    kernel=limit_opening,
    parameters=(
        Parameter("limit", "1", 0.7, (0.02, 1.0), "largest opening, of full opening",
                  "flow through narrow ports behind the lands", null=1.0),
    ),
    equation="o = min(max(s, -l), l)",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="large steps at constant supply pressure",
    confused_with=("supply_droop", "valve_gain_curve"),
    distinguished_by="large steps while the supply pressure stands",
    order=50,
)
