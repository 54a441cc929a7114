"""ARX models by least squares: fit, one-step prediction, free run, poles and transfer function.

The model of order (na, nb, nk) with sampling time T is, [1] eq. (4.7),

    y(t) + a₁·y(t−1) + … + a_na·y(t−na) = b₁·u(t−nk) + … + b_nb·u(t−nk−nb+1) + c + e(t)

[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from hydraulic_sim.arrays import Array
from hydraulic_sysid.linear.errors import IdentificationError

from .experiments import experiments, lengths_agree
from .free_run import free_run
from .model import LinearModel, coefficient_table
from .poles import Pole, sampled_poles
from .tall_least_squares import solve


@dataclass(frozen=True)
class ArxOrder:
    """Numbers of past outputs ``na``, of past inputs ``nb``, and the dead time ``nk``, in samples."""

    na: int
    nb: int
    nk: int

    def __post_init__(self) -> None:
        if self.na < 1 or self.nb < 1 or self.nk < 0:
            raise IdentificationError(
                f"ARX order ({self.na}, {self.nb}, {self.nk}): na and nb must be at least 1, nk at least 0"
            )

    @property
    def memory(self) -> int:
        """Samples of the past that one prediction needs."""
        return max(self.na, self.nb + self.nk - 1)

    @property
    def text(self) -> str:
        """The usual name: ``ARX(3, 3, 1)``."""
        return f"ARX({self.na}, {self.nb}, {self.nk})"


@dataclass(frozen=True, kw_only=True)
class ArxModel(LinearModel):
    """An identified ARX model; see the module's docstring for the equation and signs."""

    minimised = "one_step"

    order: ArxOrder
    a: Array
    """``(na,)`` coefficients a₁ … a_na."""
    b: Array
    """``(nb,)`` coefficients b₁ … b_nb."""
    constant: float
    """c: the effect of constant offsets of input and output, 0 unless it was estimated."""
    standard_errors: Array
    """``(na + nb [+ 1],)`` standard errors of a, b and, where it was estimated, c."""
    condition_number: float
    """Of the regression matrix with columns scaled to unit length."""
    method: str = "least squares"

    @property
    def parameters(self) -> int:
        """See `LinearModel.parameters`."""
        return self.standard_errors.size

    @property
    def memory(self) -> int:
        """See `LinearModel.memory`."""
        return self.order.memory

    def coefficients(self) -> list[tuple[str, float, float]]:
        """Name, value and standard error of every estimated coefficient."""
        names = [f"a{i + 1}" for i in range(self.order.na)] + [f"b{i + 1}" for i in range(self.order.nb)]
        return coefficient_table(names, [*self.a, *self.b], self.constant, self.standard_errors)

    def transfer_function(self) -> tuple[Array, Array]:
        """Numerator and denominator in descending powers of z, for ``control.TransferFunction(num, den, dt)``."""
        length = max(self.order.na, self.order.nk + self.order.nb - 1) + 1
        num, den = np.zeros(length), np.zeros(length)
        den[: self.order.na + 1] = np.concatenate(([1.0], self.a))
        num[self.order.nk : self.order.nk + self.order.nb] = self.b
        first = int(np.flatnonzero(num)[0]) if num.any() else length - 1
        return num[first:], den

    def poles(self) -> tuple[Pole, ...]:
        """Poles, slowest first."""
        return sampled_poles(np.concatenate(([1.0], self.a)), self.dt)

    def predict(self, drive: ArrayLike, output: ArrayLike) -> Array:
        """One-step prediction ``(N,)`` of the output; the first ``order.memory`` values are NaN (no past)."""
        u, y = lengths_agree(drive, output)
        past = np.column_stack(regressors(u - self.input_offset, y - self.output_offset, self.order))
        theta = np.concatenate((self.a, self.b))
        head = np.full(self.order.memory, np.nan)
        return np.concatenate((head, past @ theta + self.constant + self.output_offset))

    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None) -> Array:
        """Free run ``(N,)`` on the drive alone (see `free_run`), from rest at the output offset without ``output``."""
        u = np.asarray(drive, dtype=float) - self.input_offset
        y = None if output is None else lengths_agree(drive, output)[1]
        den = np.concatenate(([1.0], self.a))
        num = np.concatenate((np.zeros(self.order.nk), self.b))
        with np.errstate(over="ignore", invalid="ignore"):
            forced = lfilter(num, den, u) + lfilter([1.0], den, np.full(u.size, self.constant)) + self.output_offset

        def modes() -> Array:
            units = np.eye(self.order.memory)  # of the filter state that the past leaves behind
            return np.stack([lfilter(num, den, np.zeros(u.size), zi=unit)[0] for unit in units], axis=1)

        return free_run(forced, y, modes)


def fit_arx(
    drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], dt: float, order: ArxOrder, offsets: str = "estimate"
) -> ArxModel:
    """Least-squares ARX model over one or several experiments, sampled alike every ``dt`` seconds.

    ``offsets``: ``estimate`` adds the constant c to the unknowns, which keeps a null bias apart from the
    dynamics; ``remove`` subtracts the means of the data; ``none`` takes the data as they are.

    :raises IdentificationError: too few samples, unequal lengths, or an input that does not excite the order.
    """
    pairs, u0, y0 = experiments(drives, outputs, offsets)
    chunks = [[*regressors(u, y, order, offsets == "estimate"), y[order.memory :]] for u, y in pairs]
    count = order.na + order.nb + int(offsets == "estimate")
    enough(sum(chunk[-1].size for chunk in chunks), count, dt)
    found = solve(chunks)
    variance = found.squares / (found.rows - count)
    return ArxModel(
        order=order,
        dt=dt,
        a=found.theta[: order.na],
        b=found.theta[order.na : order.na + order.nb],
        constant=float(found.theta[-1]) if offsets == "estimate" else 0.0,
        input_offset=u0,
        output_offset=y0,
        standard_errors=np.sqrt(variance * np.diag(found.covariance)),
        loss=found.squares / found.rows,
        samples=found.rows,
        condition_number=found.condition,
    )


def regressors(u: Array, y: Array, order: ArxOrder, constant: bool = False) -> list[Array]:
    """Columns −y(t−1) … −y(t−na), u(t−nk) … u(t−nk−nb+1) [, 1] for t = memory … N−1.

    :raises IdentificationError: fewer samples than the model looks back.
    """
    first, n = order.memory, y.size
    if n <= first:
        raise IdentificationError(f"{n} samples are too few for a model that looks {first} samples back")
    negative = -y
    columns = [negative[first - i : n - i] for i in range(1, order.na + 1)]
    columns += [u[first - i : n - i] for i in range(order.nk, order.nk + order.nb)]
    return [*columns, np.ones(n - first)] if constant else columns


def enough(samples: int, count: int, dt: float) -> None:
    """Refuse fewer than two samples for each parameter.

    :raises IdentificationError: there are fewer.
    """
    if samples <= 2 * count:
        raise IdentificationError(
            f"{samples} usable samples at {dt:g} s are too few for {count} parameters: "
            "take a longer record, a shorter sampling time or a lower order"
        )
