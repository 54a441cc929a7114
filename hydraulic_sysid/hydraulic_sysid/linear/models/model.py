"""What every identified model is and can do, whatever its structure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from numpy.typing import ArrayLike

from hydraulic_sim.arrays import Array

from .poles import Pole


@dataclass(frozen=True, kw_only=True)
class LinearModel(ABC):
    """An identified single-input, single-output model, sampled or continuous."""

    minimised: ClassVar[str]
    """Which error ``loss`` is of: ``one_step`` or ``free_run``."""

    dt: float
    """Sampling time [s] of the data that it was estimated from and that it is run on."""
    input_offset: float
    """Mean of the estimation input, where means were subtracted; else 0."""
    output_offset: float
    """Mean of the estimation output, where means were subtracted; else 0."""
    loss: float
    """Mean squared error, over the estimation data, that the fit has made small."""
    samples: int
    """How many samples it was estimated from."""

    @property
    @abstractmethod
    def parameters(self) -> int:
        """How many values of the model were estimated, initial states and noise model left out."""

    @property
    @abstractmethod
    def memory(self) -> int:
        """Samples at the beginning for which there is no one-step prediction (NaN)."""

    @abstractmethod
    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None) -> Array:
        """Free run ``(N,)`` on the drive, from the initial state that fits ``output`` best; NaN if unstable."""

    @abstractmethod
    def predict(self, drive: ArrayLike, output: ArrayLike) -> Array:
        """One-step prediction ``(N,)`` from measured outputs; the first ``memory`` values are NaN."""

    @abstractmethod
    def poles(self) -> tuple[Pole, ...]:
        """Poles, slowest first."""

    @abstractmethod
    def transfer_function(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of z or s."""

    @abstractmethod
    def coefficients(self) -> list[tuple[str, float, float]]:
        """Name, value and standard error (NaN where there is none) of every coefficient."""


def coefficient_table(
    names: Sequence[str], values: Sequence[float], constant: float, errors: Array
) -> list[tuple[str, float, float]]:
    """Rows of `LinearModel.coefficients`; the constant c is one of them where there is a standard error for it."""
    rows = zip([*names, "c"], [*values, constant], errors, strict=False)
    return [(name, float(value), float(error)) for name, value, error in rows]
