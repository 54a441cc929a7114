"""End cushion: near the stops the piston throttles the oil it pushes out.

    F = −c·v·|v|·r²,   r = (|x| − stroke/2 + l)/l within the last l of the stroke, only towards the stop

(leaving, a check valve feeds the piston.) A cushion longer than half the stroke begins in the middle.

Source: Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4 (cylinder cushioning); orifice drop ∝ v².
"""

from hydraulic_sim.effect import Effect, Parameter


def force(position, velocity, stroke, coefficient, length):
    side = 1.0 if position > 0.0 else -1.0
    depth = abs(position) - max(0.5 * stroke - length, 0.0)
    if depth <= 0.0 or side * velocity <= 0.0:
        return 0.0
    r = min(depth / length, 1.0)
    return -coefficient * velocity * abs(velocity) * r * r


EFFECT = Effect(
    slot="force",
    summary="throttling near the stops",
    kernel=force,
    parameters=(
        Parameter("coefficient", "N*s^2/m^2", 2e5, (0.0, 1e9), "force over the square of speed at the stop",
                  "cushions take a moving load to rest within their length", null=0.0),
        Parameter("length", "m", 0.08, (1e-3, 1.0), "length of the cushion", "cylinder catalogues: 20 to 100 mm"),
    ),
    equation="F = -c*v*|v|*r^2 within the cushion, towards the stop",
    source="Jelali & Kroll (2003), Hydraulic Servo-systems, ch. 4",
    excited_by="strokes into the ends, inward and outward",
    confused_with=("position_dependent_friction", "end_stop"),
    distinguished_by="near the stops, inward against outward",
)
