"""Polynomials of a two-degree-of-freedom digital controller with integral action.

    R(q)·u = T(q)·r − S(q)·y,   A·R + B·S = A_m·A_o,   R = (q − 1)(q + ρ),   T = A_m(1)/B(1)·A_o

for K/(s(Ts + 1)) sampled with a zero-order hold: Åström & Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, ch. 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hydraulic_control.errors import ControlError


@dataclass(frozen=True)
class Polynomials:
    """t0 [V/m]; S = s0·q² + s1·q + s2 [V/m]; R = q² + r1·q + r2; A_o = q² + o1·q + o2."""

    t0: float
    s0: float
    s1: float
    s2: float
    r1: float
    r2: float
    o1: float
    o2: float


def sampled_model(velocity_gain: float, lag: float, period: float) -> tuple[np.ndarray, np.ndarray]:
    """(B (2,), A (3,)) in descending powers of q of K/(s(Ts + 1)) under a zero-order hold of ``period`` [s]."""
    decay = math.exp(-period / lag)
    b1 = velocity_gain * (period - lag * (1.0 - decay))
    b2 = velocity_gain * (lag * (1.0 - decay) - decay * period)
    return np.array([b1, b2]), np.array([1.0, -1.0 - decay, decay])


def oscillator(frequency: float, damping: float, period: float) -> np.ndarray:
    """(3,) polynomial whose roots are the poles of s² + 2ζω·s + ω² sampled every ``period`` [s]."""
    poles = np.roots([1.0, 2.0 * damping * frequency, frequency**2])
    return np.real(np.poly(np.exp(poles * period)))


def design(
    velocity_gain: float, lag: float, frequency: float, damping: float, observer: float, period: float
) -> Polynomials:
    """Polynomials that place the closed loop's poles, and two equal real ones of the observer [rad/s].

    :raises ControlError: the poles lie too high for the period, or the model cannot be solved for.
    """
    if max(frequency, observer) * period > math.pi:
        raise ControlError(
            f"pole_placement: {max(frequency, observer):g} rad/s is above the Nyquist frequency of the period "
            f"{period:g} s ({math.pi / period:g} rad/s)"
        )
    b, a = sampled_model(velocity_gain, lag, period)
    wanted, seen = oscillator(frequency, damping, period), oscillator(observer, 1.0, period)
    with_integrator = np.polymul(a, [1.0, -1.0])  # the known part of R
    right = np.polymul(wanted, seen)
    columns = [
        np.concatenate(([0.0], with_integrator)),  # ρ
        np.concatenate(([0.0], b, [0.0, 0.0])),  # s0
        np.concatenate(([0.0, 0.0], b, [0.0])),
        np.concatenate(([0.0, 0.0, 0.0], b)),
    ]
    matrix = np.column_stack(columns)
    rest = right - np.concatenate((with_integrator, [0.0]))
    try:
        rho, s0, s1, s2 = np.linalg.solve(matrix[1:], rest[1:])
    except np.linalg.LinAlgError as error:
        raise ControlError(f"pole_placement: the model cannot be placed: {error}") from None
    r = np.polymul([1.0, -1.0], [1.0, rho])
    t0 = np.polyval(wanted, 1.0) / np.polyval(b, 1.0)
    return Polynomials(float(t0), float(s0), float(s1), float(s2), float(r[1]), float(r[2]), seen[1], seen[2])
