"""Does the plant apply what is commanded?"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass
class _Range:
    """The least and the greatest of some values [V]."""

    low: float = math.inf
    high: float = -math.inf

    def add(self, value: float) -> None:
        if value < self.low:
            self.low = value
        if value > self.high:  # NaN fails both comparisons and leaves no trace
            self.high = value

    def joined(self, other: _Range) -> _Range:
        return _Range(min(self.low, other.low), max(self.high, other.high))


@dataclass
class _Block:
    commanded: _Range = field(default_factory=_Range)
    applied: _Range = field(default_factory=_Range)


class AppliedDriveCheck:
    """Compares the drive that the plant reports as applied with what was commanded, in blocks of `window` [s].

    A plant follows late, and an amplifier may follow coarsely, so single samples are not compared. At the end
    of each block the applied drives must lie within the range of this and the last block's commands, and must
    have covered the middle half of the last block's range, both within `tolerance` [V]. The second condition
    finds a plant that stands at 0 V under a fast signal around zero. The first block is not judged: the plant
    may be about to obey. It takes `patience` bad blocks in a row to make a fault: a process that the machine
    held up for a moment answers a bundle of states late, and catches up.
    """

    def __init__(self, tolerance: float = 0.1, window: float = 0.2, patience: int = 3) -> None:
        self.tolerance, self.window, self.patience = tolerance, window, patience
        self._bad_blocks = 0
        self._last: _Block | None = None
        self._block = _Block()
        self._block_end: float | None = None

    def commanded(self, drive: float) -> None:
        """Note that `drive` [V] was commanded in answer to the latest state."""
        self._block.commanded.add(drive)

    def fault(self, t: float, applied: float) -> str | None:
        """What is wrong with the applied drives up to `applied` [V] at `t` [s]; None while nothing is."""
        if self._block_end is None:
            self._block_end = t + self.window
        self._block.applied.add(applied)
        if t < self._block_end:
            return None
        found = self._verdict(self._last, self._block) if self._last is not None else None
        self._last, self._block, self._block_end = self._block, _Block(), t + self.window
        self._bad_blocks = self._bad_blocks + 1 if found else 0
        return found if self._bad_blocks >= self.patience else None

    def _verdict(self, last: _Block, block: _Block) -> str | None:
        if block.applied.low > block.applied.high:
            return "the plant does not report the drive it applies"
        allowed = last.commanded.joined(block.commanded)
        wanted, seen = last.commanded, last.applied.joined(block.applied)
        margin = 0.25 * (wanted.high - wanted.low) + self.tolerance
        beyond = block.applied.low < allowed.low - self.tolerance or block.applied.high > allowed.high + self.tolerance
        behind = seen.high < wanted.high - margin or seen.low > wanted.low + margin
        if not beyond and not behind:
            return None
        return (
            f"the plant applied {block.applied.low:.3f} … {block.applied.high:.3f} V"
            f" while {allowed.low:.3f} … {allowed.high:.3f} V was commanded"
        )
