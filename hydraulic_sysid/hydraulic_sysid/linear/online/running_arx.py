"""An ARX model estimated from a fast stream of (drive, output): sampling, recursive least squares, and its fit.

The stream is brought to the model's sampling time as it comes; see `resampling` for the rule.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hydraulic_sysid.linear.models import ArxOrder, IdentificationError, RecursiveArx, write_linear_model
from hydraulic_sysid.linear.models.recursive_arx import Step

UNITS = {"position": "m", "velocity": "m/s", "force": "N"}
"""What can be modelled, and its unit."""
_USUAL_SIZES = {"position": 0.1, "velocity": 0.1, "force": 1e4}
_USUAL_DRIVE = 1.0


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


class RunningFit:
    """Best fit 100·(1 − √(Σe²/Σ(y − ȳ)²)), every sum with the weight λⁿ of a sample n samples ago."""

    def __init__(self, forgetting: float) -> None:
        self.forgetting = forgetting
        self._weight = self._mean = self._spread = self._squares = 0.0

    def take(self, measured: float, predicted: float) -> None:
        """One more sample."""
        keep = self.forgetting
        before = self._weight
        self._weight = keep * before + 1.0
        away = measured - self._mean
        self._mean += away / self._weight
        # West's update of a weighted variance (Comm. ACM 22 (1979) 532–535), with decaying weights.
        self._spread = keep * self._spread + away * (measured - self._mean)
        self._squares = keep * self._squares + (measured - predicted) ** 2

    @property
    def best_fit(self) -> float:
        """Percent; NaN before the output has moved."""
        return 100.0 * (1.0 - math.sqrt(self._squares / self._spread)) if self._spread > 0.0 else math.nan

    @property
    def rms(self) -> float:
        """Root mean square of the error of late, in the output's unit; NaN before the first sample."""
        return math.sqrt(self._squares / self._weight) if self._weight else math.nan


class RunningArx:
    """From the drive [V] to ``output``, one of `UNITS`, sampled every ``sampling_time`` seconds.

    :raises IdentificationError: an order without dead time, a forgetting factor outside 0.5 … 1, another output.
    """

    def __init__(
        self,
        order: ArxOrder,
        sampling_time: float,
        forgetting: float,
        output: str = "position",
        gap_ns: int = 20_000_000,
    ) -> None:
        if output not in UNITS:
            raise IdentificationError(f"output is {output!r}; allowed are {', '.join(UNITS)}")
        self.output = output
        self.estimate = RecursiveArx(
            order, sampling_time, forgetting, input_scale=_USUAL_DRIVE, output_scale=_USUAL_SIZES[output]
        )
        self.fit = RunningFit(forgetting)
        self._sampler = SlowSampler(round(sampling_time * 1e9), gap_ns)

    def take(self, stamp_ns: int, drive: float, output: float) -> Iterator[tuple[int, Step]]:
        """Learn from a state; the steps that it completed, with their stamps."""
        for slow in self._sampler.take(stamp_ns, drive, output):
            if not slow.follows:
                self.estimate.forget_past()
            step = self.estimate.update(slow.drive, slow.output)
            if step is not None:
                # What a model does not foresee before it has learned anything says nothing about it.
                if self.estimate.updates > 2 * self.estimate.theta.size:
                    self.fit.take(step.measured, step.predicted)
                yield slow.stamp_ns, step

    def set_forgetting(self, value: float) -> None:
        """Forget by this factor from now on.

        :raises IdentificationError: it lies outside 0.5 … 1.
        """
        self.estimate.forgetting = self.fit.forgetting = value

    def save(self, path: str) -> Path:
        """Write the model as it is now.

        :raises IdentificationError: no path, too few samples yet, or something else lies there.
        """
        if not path:
            raise IdentificationError("no file given; set save_to")
        if self.estimate.updates <= 2 * self.estimate.theta.size:
            raise IdentificationError(f"{self.estimate.updates} samples are too few for a model")
        return write_linear_model(
            Path(path).expanduser(),
            self.estimate.model(),
            name=f"{self.estimate.order.text} estimated while running",
            input={"channel": "drive", "unit": "V"},
            output={"channel": self.output, "unit": UNITS[self.output]},
        )
