"""ARX coefficients that follow the plant sample by sample: recursive least squares with forgetting.

With the regressor φ of `arx.regressors` and the forgetting factor λ, [1] eq. (11.12):

    ε = y − φᵀθ,   K = P·φ/(λ + φᵀP·φ),   θ ← θ + K·ε,   P ← (P − K·φᵀP)/λ

With λ = 1 this is the least squares of all samples; otherwise a sample counts λⁿ after n more. Without excitation P
would grow without bound (wind-up): it stops being divided by λ once its trace has come back to where it began. Setting
P back to its beginning (`reset_covariance`) makes the estimate forget all at once, for a plant that has just changed.
While drive and output stand still there is nothing to learn but noise, and nothing is learned.

[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999, section 11.2.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.linear.errors import IdentificationError

from .arx import ArxModel, ArxOrder
from .poles import Pole, sampled_poles

_STILL = 6.0  # an output that spans less, in standard deviations of the error, stands still
_UNCERTAIN = 1e6  # prior variance of every coefficient, in the units of the scaled regressor


@dataclass(frozen=True)
class Step:
    """What one sample showed: the output predicted before it was seen, and the error, in the output's unit."""

    measured: float
    predicted: float

    @property
    def error(self) -> float:
        """Measured − predicted."""
        return self.measured - self.predicted


class RecursiveArx:
    """A running estimate; `update` takes one sample at a time.

    ``input_scale`` and ``output_scale`` are the usual sizes of the signals (V, m): they make the beginning equally
    uncertain for all coefficients and keep P well conditioned. ``constant`` estimates an offset along.

    :raises IdentificationError: an order without dead time (the input of the present sample is not over yet), or a
    forgetting factor outside 0.5 … 1.
    """

    def __init__(
        self,
        order: ArxOrder,
        dt: float,
        forgetting: float = 0.995,
        *,
        constant: bool = True,
        input_scale: float = 1.0,
        output_scale: float = 1.0,
    ) -> None:
        if order.nk < 1:
            raise IdentificationError(f"{order.text}: a running estimate needs a dead time nk of at least 1 sample")
        self.order, self.dt = order, dt
        self.forgetting = forgetting
        self._u_scale, self._y_scale = input_scale, output_scale
        self._size = order.na + order.nb + int(constant)
        self._constant = constant
        self._theta = np.zeros(self._size)
        self._theta[0] = -1.0  # until something is known: the output stays where it is
        self._u: deque[float] = deque(maxlen=order.nb + order.nk - 1)
        self._y: deque[float] = deque(maxlen=order.na)
        self._recent: deque[tuple[float, float]] = deque(maxlen=2 * order.memory + 2)
        self._squares = self._weight = 0.0
        self.updates = 0
        self.reset_covariance()

    @property
    def forgetting(self) -> float:
        """λ: 1 remembers all samples alike, 0.99 the last hundred or so."""
        return self._forgetting

    @forgetting.setter
    def forgetting(self, value: float) -> None:
        if not 0.5 <= value <= 1.0:
            raise IdentificationError(f"forgetting factor {value:g}: 0.5 … 1 is allowed")
        self._forgetting = value

    def reset_covariance(self) -> None:
        """Forget how sure the estimate was, not the estimate: the next samples count as if they were the first."""
        self._p = _UNCERTAIN * np.eye(self._size)
        self._squares = self._weight = 0.0

    def forget_past(self) -> None:
        """Drop the past samples, not the estimate: after a gap in the data."""
        self._u.clear()
        self._y.clear()
        self._recent.clear()

    def update(self, drive: float, output: float) -> Step | None:
        """Take the ``output`` at an instant and the mean ``drive`` over the sample that has just ended there.

        None until there is a past to predict from.
        """
        self._u.appendleft(drive / self._u_scale)
        y = output / self._y_scale
        self._recent.append((self._u[0], y))
        step = None
        if len(self._y) == self.order.na and len(self._u) == self._u.maxlen:
            regressor = np.array([*(-v for v in self._y), *list(self._u)[self.order.nk - 1 :], 1.0][: self._size])
            predicted = float(regressor @ self._theta)
            step = Step(output, predicted * self._y_scale)
            if not self._still():
                self._learn(regressor, y - predicted)
        self._y.appendleft(y)
        return step

    def _still(self) -> bool:
        """Whether drive and output have stood still for twice as long as the model looks back."""
        if len(self._recent) < 2 * self.order.memory + 2 or self._weight <= self._size:
            return False
        drives, outputs = zip(*self._recent, strict=True)
        noise = float(np.sqrt(self._squares / self._weight))
        return max(drives) == min(drives) and max(outputs) - min(outputs) <= _STILL * noise

    def _learn(self, regressor: Array, error: float) -> None:
        gain = self._p @ regressor
        weight = self._forgetting + float(regressor @ gain)
        self._theta += gain * (error / weight)
        following = self._p - np.outer(gain, gain) / weight
        if np.trace(following) < self._forgetting * _UNCERTAIN * self._size:
            following /= self._forgetting
        self._p = 0.5 * (following + following.T)  # rounding must not make it lose its symmetry
        # The error before the sample was learned from, scaled by its weight, is the unbiased one.
        self._squares = self._forgetting * self._squares + error**2 * self._forgetting / weight
        self._weight = self._forgetting * self._weight + 1.0
        self.updates += 1

    @property
    def theta(self) -> Array:
        """``(na + nb [+ 1],)`` coefficients a, b and, where estimated, c, in the signals' units."""
        return self._theta * self._units()

    @property
    def standard_errors(self) -> Array:
        """Of `theta`, with the noise estimated from the errors of late; infinite before there are enough."""
        left = self._weight - self._size
        if left <= 0.0:
            return np.full(self._size, np.inf)
        return np.sqrt(self._squares / left * np.diag(self._p)) * self._units()

    @property
    def certainty(self) -> float:
        """Trace of P as a share of that of the beginning: 1 knows nothing."""
        return float(np.trace(self._p) / (_UNCERTAIN * self._size))

    def names(self) -> list[str]:
        """``a1`` … ``b1`` … ``c``, as in `theta`."""
        named = [f"a{i + 1}" for i in range(self.order.na)] + [f"b{i + 1}" for i in range(self.order.nb)]
        return [*named, "c"][: self._size]

    def poles(self) -> tuple[Pole, ...]:
        """Poles of the present estimate, slowest first."""
        return sampled_poles(np.concatenate(([1.0], self.theta[: self.order.na])), self.dt)

    def model(self) -> ArxModel:
        """The present estimate as a model that can be run and written."""
        na, nb, theta = self.order.na, self.order.nb, self.theta
        return ArxModel(
            order=self.order,
            dt=self.dt,
            a=theta[:na],
            b=theta[na : na + nb],
            constant=float(theta[-1]) if self._constant else 0.0,
            input_offset=0.0,
            output_offset=0.0,
            standard_errors=self.standard_errors,
            loss=self._squares / max(self._weight, 1.0) * self._y_scale**2,
            samples=self.updates,
            condition_number=float(np.sqrt(np.linalg.cond(self._p))),
            method="recursive least squares",
        )

    def _units(self) -> Array:
        """Factors from the scaled coefficients to those in the signals' units."""
        b = self._y_scale / self._u_scale
        return np.array([1.0] * self.order.na + [b] * self.order.nb + [self._y_scale])[: self._size]
