"""End stops: contact stiffness and damping at both ends of the stroke.

    F = −(k·δ + c·v·r(δ)),  δ = |x| − stroke/2 > 0 at the extending end, mirrored at the other;
    never pulling, and the damping grows over the first hundredth of a millimetre (r) so that contact is continuous.

Source: Hunt & Crossley (1975), J. Applied Mechanics 42, for damping that vanishes at first touch.
"""

from hydraulic_sim.effect import Effect, Parameter


def force(position, velocity, stroke, stiffness, damping):
    depth = abs(position) - 0.5 * stroke
    if depth <= 0.0:
        return 0.0
    side = 1.0 if position > 0.0 else -1.0
    grown = min(depth / 1e-5, 1.0)
    return -side * max(stiffness * depth + damping * grown * side * velocity, 0.0)


EFFECT = Effect(
    slot="force",
    summary="contact at both ends of the stroke",
    kernel=force,
    parameters=(
        Parameter("stiffness", "N/m", 6.14e8, (1e3, 1e11), "contact stiffness",
                  "Nisar & Munawar, table of parameters", free=False),
        Parameter("damping", "N*s/m", 200.0, (0.0, 1e8), "contact damping", "Nisar & Munawar, table of parameters",
                  free=False),
    ),
    equation="F = -(k*d + c*v), d = |x| - stroke/2 > 0, never pulling",
    source="Hunt & Crossley (1975), J. Applied Mechanics 42",
    excited_by="driving against a stop",
    confused_with=(),
    distinguished_by="acts at the stops only",
    step_rate=lambda p: (p["stiffness"] / p["moving_mass"]) ** 0.5,
    always_on=True,
)
