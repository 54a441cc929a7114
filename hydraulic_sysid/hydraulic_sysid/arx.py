"""ARX models by least squares: fit, one-step prediction, free run, poles and transfer function.

The model of order (na, nb, nk) with sampling time T is, [1] eq. (4.7),

    y(t) + a₁·y(t−1) + … + a_na·y(t−na) = b₁·u(t−nk) + … + b_nb·u(t−nk−nb+1) + c + e(t)

[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
_OVERFLOW = 1e8
OFFSETS = ("estimate", "remove", "none")


class IdentificationError(ValueError):
    """The data cannot give the model that was asked for (too short, input not moving, wrong order)."""


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
    def state_size(self) -> int:
        """Length of the filter state that the past leaves behind."""
        return max(self.na, self.nb + self.nk - 1, 1)


@dataclass(frozen=True)
class Pole:
    """One pole of a sampled model with what it means in continuous time (s = ln(z)/T)."""

    z: complex
    natural_frequency: float
    """|s|/(2π) in Hz."""
    damping: float
    """−Re(s)/|s|; 1 for a real stable pole, 0 for an undamped one or a pure integrator."""

    @property
    def stable(self) -> bool:
        """True strictly inside the unit circle."""
        return abs(self.z) < 1.0


@dataclass(frozen=True)
class ArxModel:
    """An identified ARX model; see the module's docstring for the equation and signs."""

    order: ArxOrder
    dt: float
    a: Array
    """``(na,)`` coefficients a₁ … a_na."""
    b: Array
    """``(nb,)`` coefficients b₁ … b_nb."""
    constant: float
    """c: the effect of constant offsets of input and output, 0 unless it was estimated."""
    input_offset: float
    """Mean of the estimation input, subtracted first; 0 unless offsets were removed."""
    output_offset: float
    standard_errors: Array
    """``(na + nb [+ 1],)`` standard errors of a, b and, where it was estimated, c."""
    loss: float
    """Mean squared one-step prediction error over the estimation data."""
    samples: int
    condition_number: float
    """Of the regression matrix with columns scaled to unit length."""

    @property
    def parameters(self) -> int:
        """How many values were estimated."""
        return self.standard_errors.size

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
        poles = []
        for z in np.roots(np.concatenate(([1.0], self.a))):
            s = np.log(complex(z)) / self.dt if z != 0.0 else complex(-np.inf)
            size = abs(s)
            damping = float(-s.real / size) if 0.0 < size < np.inf else (1.0 if size else 0.0)
            poles.append(Pole(complex(z), float(size / (2.0 * np.pi)), damping))
        return tuple(sorted(poles, key=lambda p: (p.natural_frequency, p.z.imag)))

    def predict(self, drive: ArrayLike, output: ArrayLike) -> Array:
        """One-step prediction ``(N,)`` of the output; the first ``order.memory`` values are NaN (no past)."""
        u, y = _same_length(drive, output)
        past = _regressors(u - self.input_offset, y - self.output_offset, self.order)
        theta = np.concatenate((self.a, self.b))
        head = np.full(self.order.memory, np.nan)
        return np.concatenate((head, past @ theta + self.constant + self.output_offset))

    def simulate(self, drive: ArrayLike, output: ArrayLike | None = None) -> Array:
        """Free run ``(N,)`` on the drive alone.

        The initial state is the one that fits the measured ``output`` best (least squares over the whole
        record, as MATLAB's ``compare`` does by default), or rest at the output offset if no output is given.
        NaN throughout if the model is too unstable to be run.
        """
        u = np.asarray(drive, dtype=float) - self.input_offset
        den = np.concatenate(([1.0], self.a))
        num = np.concatenate((np.zeros(self.order.nk), self.b))
        forced = lfilter(num, den, u) + lfilter([1.0], den, np.full(u.size, self.constant))
        forced = forced + self.output_offset
        if output is None:
            return forced
        _, y = _same_length(drive, output)
        if not np.isfinite(forced).all() or np.abs(forced).max() > _OVERFLOW:
            return np.full(u.size, np.nan)
        size = self.order.state_size
        # States of an unstable model grow beyond what a least-squares fit can weigh.
        modes = np.stack([lfilter(num, den, np.zeros(u.size), zi=unit)[0] for unit in np.eye(size)], axis=1)
        if not np.abs(modes).max() < _OVERFLOW:
            return np.full(u.size, np.nan)
        state, *_ = np.linalg.lstsq(modes, y - forced, rcond=None)
        return forced + modes @ state


def fit_arx(
    drives: Sequence[ArrayLike], outputs: Sequence[ArrayLike], dt: float, order: ArxOrder, offsets: str = "estimate"
) -> ArxModel:
    """Least-squares ARX model over one or several experiments, sampled alike every ``dt`` seconds.

    ``offsets``: ``estimate`` adds the constant c to the unknowns, which keeps a null bias apart from the
    dynamics; ``remove`` subtracts the means of the data; ``none`` takes the data as they are.

    :raises IdentificationError: too few samples, unequal lengths, or an input that does not excite the order.
    """
    if offsets not in OFFSETS:
        raise IdentificationError(f"offsets: {offsets!r} is none of {', '.join(OFFSETS)}")
    pairs = [_same_length(u, y) for u, y in zip(drives, outputs, strict=True)]
    if not pairs:
        raise IdentificationError("an ARX model needs at least one experiment")
    u0 = float(np.mean(np.concatenate([u for u, _ in pairs]))) if offsets == "remove" else 0.0
    y0 = float(np.mean(np.concatenate([y for _, y in pairs]))) if offsets == "remove" else 0.0
    past = np.vstack([_regressors(u - u0, y - y0, order) for u, y in pairs])
    target = np.concatenate([(y - y0)[order.memory :] for _, y in pairs])
    if offsets == "estimate":
        past = np.column_stack((past, np.ones(len(past))))
    count = past.shape[1]
    if len(target) <= 2 * count:
        raise IdentificationError(
            f"{len(target)} usable samples at {dt:g} s are too few for {count} parameters: "
            "take a longer record, a shorter sampling time or a lower order"
        )
    theta, covariance, condition = _least_squares(past, target)
    loss = float(np.mean((target - past @ theta) ** 2))
    na, nb = order.na, order.nb
    return ArxModel(
        order=order,
        dt=dt,
        a=theta[:na],
        b=theta[na : na + nb],
        constant=float(theta[-1]) if offsets == "estimate" else 0.0,
        input_offset=u0,
        output_offset=y0,
        standard_errors=np.sqrt(loss * len(target) / (len(target) - count) * np.diag(covariance)),
        loss=loss,
        samples=len(target),
        condition_number=condition,
    )


def _least_squares(past: Array, target: Array) -> tuple[Array, Array, float]:
    """Parameters, (ΦᵀΦ)⁻¹ and condition number, with columns scaled: volts stand beside metres."""
    lengths = np.linalg.norm(past, axis=0)
    if not lengths.all():
        raise IdentificationError("the drive or the position is zero throughout: nothing can be identified")
    left, singular, right = np.linalg.svd(past / lengths, full_matrices=False)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0.0 else np.inf
    if condition > 1e12:
        raise IdentificationError(
            f"the record does not excite a model of this order (condition number {condition:.1e}): "
            "lower the order or use a richer drive"
        )
    theta = (right.T @ ((left.T @ target) / singular)) / lengths
    scaled = right.T / singular
    covariance = (scaled @ scaled.T) / np.outer(lengths, lengths)
    return theta, covariance, condition


def _regressors(u: Array, y: Array, order: ArxOrder) -> Array:
    """Rows [−y(t−1) … −y(t−na), u(t−nk) … u(t−nk−nb+1)] for t = memory … N−1."""
    first, n = order.memory, y.size
    if n <= first:
        raise IdentificationError(f"{n} samples are too few for a model that looks {first} samples back")
    outputs = [-y[first - i : n - i] for i in range(1, order.na + 1)]
    inputs = [u[first - i : n - i] for i in range(order.nk, order.nk + order.nb)]
    return np.column_stack(outputs + inputs)


def _same_length(drive: ArrayLike, output: ArrayLike) -> tuple[Array, Array]:
    u, y = np.asarray(drive, dtype=float), np.asarray(output, dtype=float)
    if u.shape != y.shape or u.ndim != 1:
        raise IdentificationError(f"drive {u.shape} and output {y.shape} must be equal and one-dimensional")
    return u, y
