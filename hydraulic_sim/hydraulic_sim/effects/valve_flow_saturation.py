"""Valve flow saturation: the opening is limited, with a corner that is more or less round.

    o = s − sign(s)·[(√(d² + w²) + d) − (√(l² + w²) − l)] / 2,   d = |s| − l,   w = r·l

Ports in series with the lands limit softly (two orifices as wide in series: r = 1.25), a stop of the spool sharply (0).

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (flow saturation); the corner is a hyperbola.
"""

import math

from hydraulic_sim.effect import Effect, Parameter


def limit_opening(opening, limit, rounding):
    if limit >= 1.0:
        return opening
    over, width = abs(opening) - limit, rounding * limit
    lost = 0.5 * (math.sqrt(over * over + width * width) + over)
    lost -= 0.5 * (math.sqrt(limit * limit + width * width) - limit)
    return math.copysign(abs(opening) - lost, opening)


EFFECT = Effect(
    slot="opening",
    summary="an opening that is limited",
    kernel=limit_opening,
    parameters=(
        Parameter("limit", "1", 0.7, (0.02, 1.0), "largest opening, of full opening",
                  "flow through narrow ports behind the lands", null=1.0),
        Parameter("rounding", "1", 0.1, (0.0, 2.0), "width of the corner, of the limit",
                  "0: a stop; 1.25: ports as narrow as the open lands"),
    ),
    equation="o = s - sign(s) [sqrt(d^2 + w^2) + d - sqrt(l^2 + w^2) + l] / 2, d = |s| - l, w = r l",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="large steps at constant supply pressure",
    confused_with=("supply_droop", "valve_gain_curve"),
    distinguished_by="large steps while the supply pressure stands",
    order=50,
)
