"""Whether a position can be true: a number, within the stroke, no jump, and as much travel as the valve promises."""

from __future__ import annotations

import math

from hydraulic_can_driver.bus import Limits

_SHARE = 0.1  # of the promised travel that a piston makes at least, under load and at little pressure


class PositionCheck:
    """Looks at one sample after the other; the first one after `forget` has nothing to be compared with.

    `tick` [s]: what the plant moves on by at a time, where it only lives from SYNC to SYNC.
    """

    def __init__(self, limits: Limits, tick: float = 0.0) -> None:
        self._limits, self._tick = limits, tick
        self._lowest = self._highest = math.nan  # of the position since the comparison began, m
        self._promised = self._least = self._most = 0.0  # of the travel that the opening promised since, m
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._last = math.nan
        self._last_ns = 0
        self._compare_from(math.nan)

    def problem(self, stamp_ns: int, position: float, opening: float = math.nan, supply: float = math.nan) -> str:
        """What is wrong with `position` [m] at `stamp_ns`; empty if nothing is.

        `opening` is that of the spool as a share of its travel, positive extends; `supply` the supply pressure [Pa];
        NaN where they are not measured.
        """
        limits, last = self._limits, self._last
        elapsed = max((stamp_ns - self._last_ns) * 1e-9, self._tick)
        low, high = limits.position[0] - limits.position_margin, limits.position[1] + limits.position_margin
        if not low <= position <= high:
            return f"position {position:g} m is out of the stroke: {low:g} ... {high:g} m"
        self._last, self._last_ns = position, stamp_ns
        if abs(position - last) > limits.velocity * elapsed:
            return (
                f"position jumps by {position - last:g} m in {elapsed:g} s; "
                f"at {limits.velocity:g} m/s it can only move {limits.velocity * elapsed:g} m"
            )
        if math.isfinite(last) and self._pushes(position, opening, supply):
            self._promised += opening * limits.full_speed * elapsed
        return self._frozen(position)

    def _pushes(self, position: float, opening: float, supply: float) -> bool:
        """Whether the piston should move: the spool is open, there is pressure, and no stop in the way."""
        limits = self._limits
        if not abs(opening) > limits.frozen_spool or supply < limits.frozen_supply:
            return False
        low, high = limits.position
        room = high - position if opening > 0.0 else position - low
        return room > limits.position_margin

    def _frozen(self, position: float) -> str:
        """Compare how far position and promise have ranged since both began."""
        if self._lowest != self._lowest:
            self._compare_from(position)
        self._lowest, self._highest = min(self._lowest, position), max(self._highest, position)
        self._least, self._most = min(self._least, self._promised), max(self._most, self._promised)
        travelled, promised = self._highest - self._lowest, self._most - self._least
        if promised < self._limits.frozen_travel:
            return ""
        self._compare_from(position)
        if travelled >= _SHARE * promised:
            return ""
        return (
            f"position is frozen at {position:g} m: it moved {1e3 * travelled:.3g} mm "
            f"where the opening of the spool promises {1e3 * promised:.3g} mm (sensor stuck or piston blocked)"
        )

    def _compare_from(self, position: float) -> None:
        self._lowest = self._highest = position
        self._promised = self._least = self._most = 0.0
