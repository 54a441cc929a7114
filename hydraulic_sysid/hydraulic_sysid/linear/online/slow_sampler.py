"""A fast stream of (drive, output) brought to a model's sampling time as it comes; see `resampling` for the rule."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SlowSample:
    """At ``stamp_ns``: the ``output`` then, and the mean ``drive`` over the sample that ended there.

    ``follows``: whether the sample before it in time was given out too; not after a gap, nor at first.
    """

    stamp_ns: int
    drive: float
    output: float
    follows: bool


class SlowSampler:
    """Averages the held drive over each slow sample and takes the output at its end, by a straight line if between.

    A sample that comes later than ``longest_gap_ns`` after the one before, or before it, starts anew.
    """

    def __init__(self, period_ns: int, longest_gap_ns: int) -> None:
        self.period_ns, self.longest_gap_ns = period_ns, longest_gap_ns
        self._last: tuple[int, float, float] | None = None
        self._end_ns = 0
        self._volt_ns = 0.0
        self._follows = False

    def take(self, stamp_ns: int, drive: float, output: float) -> list[SlowSample]:
        """The slow samples that ended with this state, whose ``drive`` is applied from ``stamp_ns`` on."""
        last, self._last = self._last, (stamp_ns, drive, output)
        if last is None or not 0 < stamp_ns - last[0] <= self.longest_gap_ns:
            self._end_ns, self._volt_ns, self._follows = stamp_ns + self.period_ns, 0.0, False
            return []
        before_ns, held, before = last
        found, now_ns = [], before_ns
        while self._end_ns <= stamp_ns:
            self._volt_ns += held * (self._end_ns - now_ns)
            share = (self._end_ns - before_ns) / (stamp_ns - before_ns)
            at_end = before + share * (output - before)
            found.append(SlowSample(self._end_ns, self._volt_ns / self.period_ns, at_end, self._follows))
            now_ns, self._volt_ns, self._follows = self._end_ns, 0.0, True
            self._end_ns += self.period_ns
        self._volt_ns += held * (stamp_ns - now_ns)
        return found
