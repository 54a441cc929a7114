"""Does the plant apply what is commanded?"""

from __future__ import annotations

import math
from dataclasses import dataclass, field


@dataclass
class _Block:
    """Drives [V] of one block."""

    commanded: list[float] = field(default_factory=list)
    applied: list[float] = field(default_factory=list)


def _range(values: list[float]) -> tuple[float, float]:
    """The least and the greatest of some values; NaN leaves no trace."""
    known = [value for value in values if value == value]
    return min(known, default=math.inf), max(known, default=-math.inf)


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
        self._block.commanded.append(drive)

    def fault(self, t: float, applied: float) -> str | None:
        """What is wrong with the applied drives up to `applied` [V] at `t` [s]; None while nothing is."""
        if self._block_end is None:
            self._block_end = t + self.window
        self._block.applied.append(applied)
        if t < self._block_end:
            return None
        found = self._verdict(self._last, self._block) if self._last is not None else None
        self._last, self._block, self._block_end = self._block, _Block(), t + self.window
        self._bad_blocks = self._bad_blocks + 1 if found else 0
        return found if self._bad_blocks >= self.patience else None

    def _verdict(self, last: _Block, block: _Block) -> str | None:
        low, high = _range(block.applied)
        if low > high:
            return "the plant does not report the drive it applies"
        least, most = _range(last.commanded + block.commanded)
        wanted_low, wanted_high = _range(last.commanded)
        seen_low, seen_high = _range(last.applied + block.applied)
        margin = 0.25 * (wanted_high - wanted_low) + self.tolerance
        beyond = low < least - self.tolerance or high > most + self.tolerance
        behind = seen_high < wanted_high - margin or seen_low > wanted_low + margin
        if not beyond and not behind:
            return None
        return f"the plant applied {low:.3f} … {high:.3f} V while {least:.3f} … {most:.3f} V was commanded"
