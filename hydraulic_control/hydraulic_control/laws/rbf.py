"""PID with a radial basis function network that learns what the PID lacks.

H.-S. Choi et al. 2013 on an electro-hydraulic actuator; R. M. Sanner, J.-J. E. Slotine, Gaussian networks for direct
adaptive control, IEEE Trans. Neural Netw. 3 (1992). The network gives a drive for the demanded speed v_d = v_r + λ·e,
such as an inverse of a dead band; dw = Γ·φ·ε/Σφ² with ε = e + τ·ė, a dead zone, and weights within bounds.
"""

from __future__ import annotations

import math
from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, number
from hydraulic_control.law_parts import at_limit, clamp, integrate, outside

_CENTRES = 15  # over demanded speeds −1 … 1 of the scale, closer together around 0


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """A PID and the network."""
    e = reference - position
    s.error = e + p.derivative * (reference_velocity - s.velocity)
    demand = clamp((reference_velocity + p.slope * e) / p.speed, 1.0)
    at = math.copysign(math.sqrt(abs(demand)), demand)
    found, s.power = 0.0, 0.0
    for i in range(_CENTRES):
        distance = (at - 2.0 * i / (_CENTRES - 1) + 1.0) * (_CENTRES - 1) / 2.0
        s.fires[i] = math.exp(-0.5 * distance * distance)
        s.power += s.fires[i] * s.fires[i]
        found += s.weights[i] * s.fires[i]
    return p.kp * e + p.ki * s.integral - p.kd * s.velocity + found


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral; learn, unless the drive is at its limit."""
    integrate(p, s, dt, e, p.ki, wanted)
    if at_limit(p, wanted):
        return
    slip = dt * p.rate * outside(s.error, p.dead_zone) / s.power
    for i in range(_CENTRES):
        s.weights[i] = clamp(s.weights[i] + s.fires[i] * (slip - dt * p.leakage * s.weights[i]), p.most)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule."""
    return fed_forward(simple, ({"rbf.speed": 5.0 * simple.velocity_gain, **g} for g in gains))


def as_is(pid: Values) -> list[dict[str, Any]]:
    """A PID, with a network that learns and with one that does not."""
    return [{**pid, "rbf.rate": rate} for rate in (0.0, 50.0)]


LAW = Law(
    description="PID with a radial basis function network that learns",
    source="Choi 2013; Sanner & Slotine 1992",
    drive=drive,
    end=end,
    parameters=(
        number("rbf.slope", 10.0, "λ of the demanded speed", "1/s", 0.0, 500.0),
        number("rbf.speed", 0.2, "demanded speed of the outermost centres", "m/s", 1e-4, 10.0),
        number("rbf.rate", 50.0, "Γ, how fast it learns", "V/(m*s)", 0.0, 1e6),
        number("rbf.derivative", 5e-3, "τ", "s", 0.0, 1.0),
        number("rbf.leakage", 0.02, "how fast what was learnt fades", "1/s", 0.0, 100.0),
        number("rbf.dead_zone", 3e-5, "error that changes nothing", "m", 0.0, 1.0),
        number("rbf.most", 0.5, "largest weight", "V", 0.0, 10.0),
    ),
    state=(("error", ()), ("power", ()), ("weights", (_CENTRES,)), ("fires", (_CENTRES,))),
    tuned=("kp", "ki", "kd", "rbf.rate"),
    starts=starts,
    follows=("pid", as_is),
    claims=(Claim("robust to varying load and pressure, beside PID (Choi 2013)", "varying", "rms_error", over="pid"),),
)
