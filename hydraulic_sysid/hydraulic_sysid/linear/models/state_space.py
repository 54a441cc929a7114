"""A sampled state-space model in innovations form: free run, one-step prediction, poles, transfer function.

    x(t+1) = A·x(t) + B·u(t) + f + K·e(t),   y(t) = C·x(t) + D·u(t) + g + e(t)

f and g stand for constant offsets of input and output; g is only there where the data's means were subtracted.
P. Van Overschee, B. De Moor, *Subspace Identification for Linear Systems*, Kluwer 1996, section 3.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import ss2tf

from hydraulic_sim.arrays import Array

from .experiments import lengths_agree
from .free_run import free_run
from .model import LinearModel
from .poles import Pole, poles_at
from .state_recursion import propagate


@dataclass(frozen=True, kw_only=True)
class StateSpaceModel(LinearModel):
    """An identified state-space model with one input and one output; equation and signs in the module's docstring."""

    minimised = "free_run"

    A: Array
    """``(n, n)``."""
    B: Array
    """``(n,)``."""
    C: Array
    """``(n,)``."""
    D: float
    K: Array
    """``(n,)`` gain of the innovations; 0 makes the one-step prediction a free run."""
    constant: Array
    """``(n,)`` f."""
    singular_values: Array
    """Of the projection of future outputs on the past; a gap after the n-th says that n is the order."""
    horizon: int
    one_step_loss: float
    constants: int
    """How many constant offsets were estimated, 0 or 1."""
    direct: bool
    """Whether D was estimated."""
    method: str = "subspace (MOESP)"
    memory: int = 0

    @property
    def order(self) -> int:
        """Number of states."""
        return self.C.size

    @property
    def parameters(self) -> int:
        """Values that the transfer function has: n poles, n (+1) of the numerator, and the constant."""
        return 2 * self.order + int(self.direct) + self.constants

    def poles(self) -> tuple[Pole, ...]:
        """Poles, slowest first."""
        return poles_at(np.linalg.eigvals(self.A), self.dt)

    def transfer_function(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of z, for ``control.TransferFunction(num, den, dt)``."""
        num, den = ss2tf(self.A, self.B[:, None], self.C[None, :], [[self.D]])
        first = 0 if self.direct else 1
        return num[0, first:], den

    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None) -> Array:
        """Free run ``(N,)`` on the drive alone (see `free_run`), from the state 0 without ``output``."""
        u = np.asarray(drive, dtype=float) - self.input_offset
        y = None if output is None else lengths_agree(drive, output)[1] - self.output_offset
        return self._run(self.A, np.outer(u, self.B) + self.constant, self.D * u, y) + self.output_offset

    def predict(self, drive: ArrayLike, output: ArrayLike) -> Array:
        """One-step prediction ``(N,)`` from measured outputs; the initial state is fitted."""
        u, y = lengths_agree(drive, output)
        u, y = u - self.input_offset, y - self.output_offset
        forcing = np.outer(u, self.B) + self.constant + np.outer(y - self.D * u, self.K)
        return self._run(self.A - np.outer(self.K, self.C), forcing, self.D * u, y) + self.output_offset

    def coefficients(self) -> list[tuple[str, float, float]]:
        """Transfer function coefficients; a subspace method gives no standard errors (NaN)."""
        num, den = self.transfer_function()
        first = 0 if self.direct else 1
        named = [(f"a{i + 1}", v) for i, v in enumerate(den[1:])] + [(f"b{i + first}", v) for i, v in enumerate(num)]
        return [(name, float(value), float("nan")) for name, value in named]

    def _run(self, transition: Array, forcing: Array, direct: Array, measured: Array | None) -> Array:
        transition = np.ascontiguousarray(transition)
        with np.errstate(over="ignore", invalid="ignore"):
            forced = propagate(transition, forcing, np.zeros(self.order)) @ self.C + direct
        return free_run(forced, measured, lambda: free_modes(transition, self.C, forced.size))


def free_modes(transition: Array, C: Array, count: int) -> Array:
    """Free responses ``(count, n)`` of the output to each unit initial state: rows C·Aᵏ."""
    return propagate(np.ascontiguousarray(transition.T), np.zeros((count, C.size)), C.copy())
