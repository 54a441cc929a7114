"""Nonlinear PID, u = k(e)·(Kp·e + Ki·∫e − Kd·dx/dt) with k(e) = k₀ + k₁·(1 − sech(k₂·e)).

[1] Z. Nisar, H. Munawar, System Identification and Controller Design for Hydraulic Actuator.
[2] H. Seraji, A new class of nonlinear PID controllers with robotic applications, J. Robotic Systems 15 (1998).

Errors are in metres. The published gain k = 4 − 3·sech(0.05·e) [1] names no unit for e: 0.05 does nothing for errors
in metres or inches of a 60 in actuator, so it can only be per millimetre, which makes k₂ = 50 1/m here.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, number
from hydraulic_control.law_parts import integrate

_SHAPES = ({"k1": 3.0, "k2": 50.0}, {"k1": 0.3, "k2": 50.0})
"""Of the nonlinear gain: the paper's, and a mild one."""


@njit(cache=True, error_model="numpy")
def nonlinear_gain(e, k0, k1, k2):
    """k(e), written with a decaying exponential: no e overflows it."""
    decay = math.exp(-abs(k2 * e)) if e != 0.0 else 1.0
    return k0 + k1 * (1.0 - 2.0 * decay / (1.0 + decay * decay))


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The law."""
    e = reference - position
    s.gain = nonlinear_gain(e, p.k0, p.k1, p.k2)
    return s.gain * (p.kp * e + p.ki * s.integral - p.kd * s.velocity)


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral."""
    integrate(p, s, dt, e, s.gain * p.ki, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Gains by rule, softened at small errors."""
    return fed_forward(simple, (_shaped(g, shape) for g in gains for shape in _SHAPES))


def softened(pid: Values) -> list[dict[str, Any]]:
    """A PID as an NPID with k = 1, and softened: a comparison of both is to be one of the laws, not of a search."""
    return [{**pid, "k1": 0.0}, *({**pid, **_shaped(pid, shape)} for shape in _SHAPES)]


def _shaped(values: Values, shape: Values) -> dict[str, Any]:
    """The gain's shape, and the gains divided by what it multiplies them with half way up."""
    return {**shape, **{n: values[n] / (1.0 + 0.5 * shape["k1"]) for n in ("kp", "ki", "kd") if n in values}}


LAW = Law(
    description="nonlinear PID: gain rises with the error",
    source="Nisar & Munawar; Seraji 1998",
    drive=drive,
    end=end,
    parameters=(
        number("k0", 1.0, "nonlinear gain at no error", "1", 0.0, 100.0),
        number("k1", 3.0, "rise of the nonlinear gain up to large errors", "1", 0.0, 100.0),
        number("k2", 50.0, "how fast it rises with the error", "1/m", 0.0, 1e5),
    ),
    state=(("gain", ()),),
    tuned=("kp", "ki", "kd", "k1", "k2"),
    starts=starts,
    follows=("pid", softened),
    claims=(
        Claim(
            "a step settles within 3 s on the nonlinear plant (Nisar & Munawar)",
            "step",
            "settling_time",
            high=3.0,
        ),
        Claim("its overshoot is 4.8 % at most (Nisar & Munawar)", "step", "overshoot", high=4.8),
    ),
)
