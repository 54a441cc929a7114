"""What every identified model can do, whatever its structure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from numpy.typing import ArrayLike

from hydraulic_sim.arrays import Array

from .poles import Pole


class LinearModel(Protocol):
    """An identified single-input, single-output model, sampled or continuous."""

    @property
    def dt(self) -> float:
        """Sampling time [s] of the data that it was estimated from and that it is run on."""

    @property
    def loss(self) -> float:
        """Mean squared error, over the estimation data, that the fit has made small."""

    @property
    def minimised(self) -> str:
        """Which error that is: ``one_step`` or ``free_run``."""

    @property
    def input_offset(self) -> float:
        """Mean of the estimation input, where means were subtracted; else 0."""

    @property
    def output_offset(self) -> float:
        """Mean of the estimation output, where means were subtracted; else 0."""

    @property
    def samples(self) -> int:
        """How many samples it was estimated from."""

    @property
    def parameters(self) -> int:
        """How many values of the model were estimated."""

    @property
    def memory(self) -> int:
        """Samples at the beginning for which there is no one-step prediction (NaN)."""

    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None) -> Array:
        """Free run ``(N,)`` on the drive, from the initial state that fits ``output`` best; NaN if unstable."""

    def predict(self, drive: ArrayLike, output: ArrayLike) -> Array:
        """One-step prediction ``(N,)`` from measured outputs."""

    def poles(self) -> tuple[Pole, ...]:
        """Poles, slowest first."""

    def transfer_function(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of z or s."""

    def coefficients(self) -> list[tuple[str, float, float]]:
        """Name, value and standard error (NaN where there is none) of every coefficient."""


def coefficient_table(
    names: Sequence[str], values: Sequence[float], constant: float, errors: Array
) -> list[tuple[str, float, float]]:
    """Rows of `LinearModel.coefficients`; the constant c is one of them where there is a standard error for it."""
    rows = zip([*names, "c"], [*values, constant], errors, strict=False)
    return [(name, float(value), float(error)) for name, value, error in rows]
