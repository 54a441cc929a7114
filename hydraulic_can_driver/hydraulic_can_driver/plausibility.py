"""Whether a position can be true: it is a number, within the stroke, no jump, and moves when the valve is open."""

from __future__ import annotations

import math

from hydraulic_can_driver.bus import Limits


class PositionCheck:
    """Looks at one sample after the other; the first one after `forget` has nothing to be compared with."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._last = math.nan
        self._last_ns = self._moved_ns = 0

    def problem(
        self, stamp_ns: int, position: float, opening: float = math.nan, supply: float = math.nan, at_end: bool = False
    ) -> str:
        """What is wrong with `position` [m] at `stamp_ns`; empty if nothing is.

        `opening` is that of the spool as a share of its travel, `supply` the supply pressure [Pa], NaN where they are
        not measured. `at_end`: the piston stands at a limit switch, where it may well not move.
        """
        limits, last, elapsed = self._limits, self._last, (stamp_ns - self._last_ns) * 1e-9
        low, high = limits.position[0] - limits.position_margin, limits.position[1] + limits.position_margin
        if not low <= position <= high:
            return f"position {position:g} m is out of the stroke: {low:g} ... {high:g} m"
        pushed = abs(opening) > limits.frozen_spool and not supply < limits.frozen_supply and not at_end
        if position != last or not pushed:
            self._moved_ns = stamp_ns
        self._last, self._last_ns = position, stamp_ns
        if abs(position - last) > limits.velocity * elapsed:
            return (
                f"position jumps by {position - last:g} m in {elapsed:g} s; "
                f"at {limits.velocity:g} m/s it can only move {limits.velocity * elapsed:g} m"
            )
        still = (stamp_ns - self._moved_ns) * 1e-9
        if still > limits.frozen_time:
            return f"position is frozen at {position:g} m for {still:.2f} s while the spool is {opening:.0%} open"
        return ""
