"""An ARX model estimated from a fast stream: sampling, recursive least squares and its fit, in one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hydraulic_sysid.linear.models import ArxOrder, IdentificationError, RecursiveArx, write_linear_model
from hydraulic_sysid.linear.models.recursive_arx import Step

from .running_fit import RunningFit
from .slow_sampler import SlowSampler

UNITS = {"position": "m", "velocity": "m/s", "force": "N"}
"""What can be modelled, and its unit."""
_USUAL_SIZES = {"position": 0.1, "velocity": 0.1, "force": 1e4}
_USUAL_DRIVE = 1.0


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
