"""How probable it is that the library holds no law that is right, by what is left when the most was explained."""

from __future__ import annotations

from dataclasses import dataclass

from .competing_models import ODDS
from .misfit import Misfit


@dataclass(frozen=True)
class Calibration:
    """The constants of `probability_of_unknown`, chosen on 237 benches of the seeds 70001 to 77001.

    With half or double of any of them the mean logarithm of the probability of what came true, −0.268, is no more than
    0.02 lower.
    """

    odds: float = ODDS
    """Of what the search found against a law that the library lacks, where nothing is left beyond the noise."""
    missed: float = 0.01
    """Mean square over noise that an estimate of the noise may miss; with it left beyond the noise an unknown law is
    twice as probable."""
    laws: float = 1e-3
    """The same, of the mean square that was explained: no law is quite that of a bench."""


CALIBRATION = Calibration()


def probability_of_unknown(before: Misfit, after: Misfit, calibration: Calibration = CALIBRATION) -> float:
    """That the library lacks the law that is right, by what is left after most was explained."""
    left, explained = after.variance - 1.0, max(before.variance - after.variance, 0.0)
    odds = (1.0 + left / (calibration.missed + calibration.laws * explained)) / calibration.odds
    return odds / (1.0 + odds)
