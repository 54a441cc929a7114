"""What every excitation signal is: settings plus a drive over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sysid.excitation.settings import Settings, number

Array = NDArray[np.float64]


def amplitude(doc: str) -> Any:
    """The usual amplitude field: peak drive in volts."""
    return number("V", doc, above=0.0, maximum=DRIVE_LIMIT_V)


@dataclass(frozen=True)
class Signal(Settings):
    """A drive signal without fades, offset or centring; those belong to the plan.

    To add a signal, put a file beside the others with one such class in it; its name in plans is the file's
    name.
    """

    def sample(self, t: Array) -> Array:
        """The drive [V] at the times `t` [s] from the signal's start; the same shape as `t`."""
        raise NotImplementedError

    @property
    def length(self) -> float | None:
        """The signal's own length [s], None where it can go on for ever."""
        return None

    @property
    def highest_frequency(self) -> float:
        """The highest frequency [Hz] that the sampling must carry."""
        return 0.0
