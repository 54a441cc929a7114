"""A continuous-time transfer function with dead time: free run, one-step prediction, poles.

    A(p)·y(t) = B(p)·u(t − τ) + c,   p = d/dt,   A(p) = pⁿ + a₁·pⁿ⁻¹ + … + a_n,   B(p) = b₀·pᵐ + … + b_m

c stands for constant offsets of input and output. The input is held over each sample. One step ahead the model is
completed by an autoregression of its own simulation error, D(q)·(y − ŷ) = e: the predictor of a Box–Jenkins model
with C = 1, [1] section 4.2.

[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from hydraulic_sim.arrays import Array
from hydraulic_sysid.linear.errors import IdentificationError

from .experiments import lengths_agree
from .free_run import free_run
from .held_filter import Filter
from .model import LinearModel, coefficient_table
from .poles import Pole, continuous_poles


@dataclass(frozen=True)
class TransferFunctionOrder:
    """Numbers of ``poles`` and ``zeros``; with ``integrator`` one of the poles is 0 and is not estimated."""

    poles: int = 3
    zeros: int = 0
    integrator: bool = False

    def __post_init__(self) -> None:
        if self.poles < 1 or not 0 <= self.zeros <= self.poles:
            raise IdentificationError(
                f"{self.poles} poles and {self.zeros} zeros: at least one pole and at most as many zeros are allowed"
            )
        if self.integrator and self.poles == 1 and self.zeros == 1:
            raise IdentificationError("one pole at 0 and one zero leave no dynamics to estimate")

    @property
    def free_poles(self) -> int:
        """Coefficients of the denominator that are estimated."""
        return self.poles - int(self.integrator)

    @property
    def text(self) -> str:
        """In words: ``third-order transfer function``."""
        names = {1: "first", 2: "second", 3: "third", 4: "fourth", 5: "fifth", 6: "sixth"}
        zeros = "" if not self.zeros else f" with {self.zeros} zero{'s' if self.zeros > 1 else ''}"
        return f"{names.get(self.poles, f'{self.poles}th')}-order transfer function{zeros}"


@dataclass(frozen=True, kw_only=True)
class TransferFunctionModel(LinearModel):
    """An identified transfer function; see the module's docstring for the equation and signs.

    ``dt`` is the sampling time of the estimation data; simulations take another one.
    """

    minimised = "free_run"

    order: TransferFunctionOrder
    numerator: Array
    """``(zeros + 1,)`` b₀ … b_m in descending powers of s."""
    denominator: Array
    """``(poles + 1,)`` 1, a₁ … a_n in descending powers of s."""
    delay: float
    """Dead time in seconds."""
    constant: float
    standard_errors: Array
    """Of the estimated coefficients: a₁ … (without the integrator's), b₀ …, c where estimated."""
    condition_number: float
    noise: Array
    """``(k,)`` coefficients d₁ … d_k of the autoregression of the simulation error; may be empty."""
    one_step_loss: float
    """Mean squared one-step prediction error over the estimation data."""
    method: str = "output error"
    converged: bool = True

    @property
    def parameters(self) -> int:
        """See `LinearModel.parameters`."""
        return self.standard_errors.size

    @property
    def memory(self) -> int:
        """See `LinearModel.memory`."""
        return self.noise.size

    def transfer_function(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of s, without the dead time, for `control`."""
        return self.numerator, self.denominator

    def poles(self) -> tuple[Pole, ...]:
        """Poles, slowest first."""
        return continuous_poles(self.denominator)

    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None, dt: float | None = None) -> Array:
        """Free run ``(N,)`` on the drive alone (see `free_run`), from rest at the output offset without ``output``.

        Sampled every ``dt`` seconds, as the estimation data by default.
        """
        u = np.asarray(drive, dtype=float) - self.input_offset
        dt = dt or self.dt
        scale = self._scale()
        n = self.order.poles
        alpha = self.denominator[1:] / scale ** np.arange(1, n + 1)
        filters = Filter(alpha, scale * dt)
        beta = self.numerator / scale ** np.arange(n - self.order.zeros, n + 1)
        with np.errstate(over="ignore", invalid="ignore"):
            forced = filters.held(u, self.delay / dt).single[:, self.order.zeros :: -1] @ beta
            if self.constant:
                forced += filters.held(np.ones(u.size)).single[:, 0] * (self.constant / scale**n)
        y = None if output is None else lengths_agree(drive, output)[1] - self.output_offset
        return free_run(forced, y, lambda: filters.impulse(u.size).single[:, :n]) + self.output_offset

    def predict(self, drive: ArrayLike, output: ArrayLike) -> Array:
        """One-step prediction ``(N,)``; the first ``memory`` values are NaN (no past error)."""
        _, y = lengths_agree(drive, output)
        free = self.simulate(drive, y)
        predicted = free - lfilter(np.concatenate(([0.0], self.noise)), [1.0], y - free)
        predicted[: self.memory] = np.nan
        return predicted

    def coefficients(self) -> list[tuple[str, float, float]]:
        """Name, value and standard error of every estimated coefficient."""
        names = [f"a{i + 1}" for i in range(self.order.free_poles)] + [f"b{i}" for i in range(self.order.zeros + 1)]
        values = [*self.denominator[1 : 1 + self.order.free_poles], *self.numerator]
        return coefficient_table(names, values, self.constant, self.standard_errors)

    def _scale(self) -> float:
        """The fastest pole [rad/s], at least one per 10⁶ samples."""
        fastest = max(2.0 * np.pi * p.natural_frequency for p in self.poles())
        return float(max(fastest, 1e-6 / self.dt))
