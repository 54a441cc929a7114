"""What an amplifier makes of the set-point before the spool follows it; all numbers are shares of full scale.

In this order: scaling, limits, ramp, directional gain, dead-band compensation, flow linearisation, zero offset. Every
one of them can hide or imitate a property of the hydraulics, which is why the driver reads them back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

TABLE_STEPS = 10  # intervals of the linearisation table over −1 … 1


@dataclass(frozen=True)
class Shaping:
    """Settings of the amplifier; the defaults change nothing.

    ``ramps`` [s per full scale]: up positive, up negative, down positive, down negative; 0 is no ramp.
    ``dead_band``: opening that is jumped over on the positive and on the negative side, and the set-point below which
    the jump is spread out. ``table``: openings at set-points −1, −0.8 … 1; empty: none.
    """

    gain: float = 1.0
    offset: float = 0.0
    lower: float = -1.0
    upper: float = 1.0
    ramps: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    positive_gain: float = 1.0
    dead_band: tuple[float, float, float] = (0.0, 0.0, 0.0)
    table: Sequence[float] = ()
    zero: float = 0.0


class Amplifier:
    """Carries set-points to openings; remembers where its ramp stands."""

    def __init__(self) -> None:
        self.shaping = Shaping()
        self.limited = self.ramping = False
        self._ramp = 0.0

    def rest(self) -> None:
        """The spool is at its centre: the next ramp starts there."""
        self._ramp, self.limited, self.ramping = 0.0, False, False

    def opening(self, setpoint: float, dt: float) -> float:
        """Opening for a set-point that holds for ``dt`` [s]."""
        s = self.shaping
        scaled = s.gain * setpoint + s.offset
        value = min(max(scaled, s.lower), s.upper)
        self.limited = value != scaled
        value = self._ramped(value, dt)
        if value > 0.0:
            value *= s.positive_gain
        value = _compensated(value, *s.dead_band)
        if s.table:
            value = _interpolated(s.table, value)
        return min(max(value + s.zero, -1.0), 1.0)

    def _ramped(self, goal: float, dt: float) -> float:
        here = self._ramp
        away = abs(goal) > abs(here) if goal * here >= 0.0 else False
        negative = here < 0.0 or (here == 0.0 and goal < 0.0)
        time = self.shaping.ramps[(0 if away else 2) + int(negative)]
        if time <= 0.0 and goal * here < 0.0:
            self._ramp = 0.0  # at the centre at once, and on from there by the ramp of the other side
            return self._ramped(goal, dt)
        if time > 0.0:
            most = dt / time
            # Not past the centre in one go: on its other side another ramp holds.
            target = goal if goal * here >= 0.0 else 0.0
            self._ramp = here + min(max(target - here, -most), most)
        else:
            self._ramp = goal
        self.ramping = self._ramp != goal
        return self._ramp


def _compensated(value: float, positive: float, negative: float, threshold: float) -> float:
    """Set-point with the dead band jumped over; full scale stays full scale."""
    jump = positive if value > 0.0 else negative
    size = abs(value)
    if jump == 0.0 or size == 0.0:
        return value
    least = max(threshold, 1e-12)
    out = jump + (1.0 - jump) * size if size >= least else (jump + (1.0 - jump) * least) * size / least
    return out if value > 0.0 else -out


def _interpolated(table: Sequence[float], value: float) -> float:
    at = (min(max(value, -1.0), 1.0) + 1.0) * 0.5 * TABLE_STEPS
    left = min(int(at), TABLE_STEPS - 1)
    return table[left] + (table[left + 1] - table[left]) * (at - left)
