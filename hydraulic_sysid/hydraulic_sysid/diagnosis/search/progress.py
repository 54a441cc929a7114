"""What a search tells while it runs: what is tried, the best so far, how the error falls and what time is left."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .errors import DiagnosisError
from .misfit import Misfit

FINISHING = 0.7  # of the time that is allowed: what remains is for the last fit and the document


class OutOfTimeError(DiagnosisError):
    """The time that a search was given is over."""


Watch = Callable[[Mapping[str, Any]], None]
"""Takes what has been found so far: ``residual`` over noise on validation data, or the table of ``candidates``."""


@dataclass
class Progress:
    """Tells ``say``, and ``watch`` what is found; ``within`` seconds of its beginning it ends the search."""

    say: Callable[[str], None]
    within: float | None = None
    watch: Watch = field(default=lambda _: None)
    begun: float = field(default_factory=time.monotonic)
    first: Misfit | None = None
    lowest: Misfit | None = None
    effects: Sequence[str] = ()

    def __call__(self, trying: str) -> None:
        """Say what comes next.

        :raises OutOfTimeError: there is no time for it.
        """
        told = [trying]
        if self.first is not None and self.lowest is not None and self.lowest is not self.first:
            fell = f"{self.first.rms_validation:.3g} → {self.lowest.rms_validation:.3g} × noise"
            told.append(f"best so far: {' + '.join(self.effects) or 'the model'}, {fell}")
        left = self.left()
        self.say(" · ".join([*told, f"{left:.0f} s left"] if math.isfinite(left) else told))

    def left(self) -> float:
        """Seconds until the search has to end.

        :raises OutOfTimeError: there are none.
        """
        if self.within is None:
            return math.inf
        left = FINISHING * self.within - (time.monotonic() - self.begun)
        if left < 0.0:
            raise OutOfTimeError(
                f"{self.within:g} s are over before the model itself was fitted; allow more, or give less data"
            )
        return left

    def reached(self, effects: Sequence[str], misfit: Misfit) -> None:
        """The model with these effects added leaves this."""
        self.first = self.first or misfit
        if self.lowest is None or misfit.total < self.lowest.total:
            self.lowest, self.effects = misfit, tuple(effects)
            self.watch({"residual": misfit.rms_validation, "effects": list(effects)})
