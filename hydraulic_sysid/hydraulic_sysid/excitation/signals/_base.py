"""What every excitation signal is: settings plus a drive over time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_sim.arrays import Array
from hydraulic_sysid.excitation.declared import Declared, declared_fields, number

S = TypeVar("S", bound="Signal")


def amplitude(doc: str) -> Any:
    """The usual amplitude field: peak drive in volts."""
    return number("V", doc, above=0.0, maximum=DRIVE_LIMIT_V)


@dataclass(frozen=True)
class Signal(Declared):
    """A drive signal without fades, offset or centring; those belong to the plan.

    To add a signal, put a file beside the others with one such class in it; its name in plans is the file's
    name.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.label = cls.__module__.rpartition(".")[2]

    def sample(self, t: Array) -> Array:
        """The drive [V] at the times `t` [s] from the signal's start; the same shape as `t`."""
        raise NotImplementedError

    def scaled(self: S, factor: float) -> S:
        """The same signal, `factor` times as large: every setting in volts is multiplied.

        :raises PlanError: a setting leaves its range.
        """
        return replace(self, **{name: _times(getattr(self, name), factor) for name in self._volts()})

    @property
    def size(self) -> float:
        """The largest of the settings in volts [V]; it grows with `scaled`."""
        return max(float(np.max(np.abs(getattr(self, name)))) for name in self._volts())

    def _volts(self) -> list[str]:
        return [item.name for item in declared_fields(type(self)) if item.metadata["declaration"].unit == "V"]

    @property
    def length(self) -> float | None:
        """The signal's own length [s], None where it can go on for ever."""
        return None

    @property
    def highest_frequency(self) -> float:
        """The highest frequency [Hz] that the sampling must carry."""
        return 0.0


class Wave(Signal):
    """A signal that repeats at its ``frequency`` [Hz]."""

    frequency: float

    @property
    def highest_frequency(self) -> float:
        return self.frequency


def _times(value: Any, factor: float) -> Any:
    return tuple(factor * item for item in value) if isinstance(value, tuple) else factor * value
