"""Fits parameters within bounds and every piece's initial state to records, by damped Gauss-Newton steps.

The initial states are eliminated at every step (variable projection, Golub & Pereyra, SIAM J. Numer. Anal. 10
(1973)), which leaves a small bounded linear problem in the parameters for `scipy.optimize.lsq_linear`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record

from .segments import Pieces, SegmentError, cut
from .shooting import Linear, Shooting
from .steps import LEAST_DAMPING, ahead, bounded_step

Array = NDArray[np.float64]

_MOST_DAMPING = 1e3
_RESTED = 1e-4  # the same for the starts alone
_RESTS = 4  # times that starts are moved where no parameter is fitted
_NEARER = 0.8  # of the misfit before: a smaller one lets unmeasured starts go further
_UPHILL = 1.0  # standard errors from the optimum at which it is no failure that no step gets any lower
_MILD = 3.0  # residual over noise from which a robust loss counts less than the square


class CalibrationError(HydraulicError, ValueError):
    """There is nothing to fit, or the data do not allow it; the message says what is needed."""


@dataclass(frozen=True)
class Settings:
    """What a user may choose about a calibration."""

    length: float = 0.5
    """Seconds of a piece."""
    robust: bool = False
    """Let residuals beyond three times the noise count less (soft L1)."""
    most_steps: int = 25
    tolerance: float = 0.1
    """The fit is done when another step would be shorter than this many standard errors."""
    least_gain: float = 1e-6
    """Or when a step lowers the sum of squares by no more than this share."""


@dataclass(frozen=True)
class Fit:
    """Where a fit ended: values [SI], whether it converged, and what the statistics are made from.

    ``information`` (P, P) and ``scores`` (S_total, P) in units of ``scales``; ``cost`` is the sum of squared
    residuals over noise, ``count`` how many of them, ``unknown`` how many initial states were estimated along.
    """

    values: dict[str, float]
    scales: dict[str, float]
    converged: bool
    steps: int
    cost: float
    count: int
    unknown: int
    information: Array
    scores: Array
    residuals: list[Array]
    """(S, m) per record, in units of the noise, the starts' priors appended."""
    shooting: Shooting
    settings: Settings

    @property
    def rms(self) -> float:
        """Residual over noise as the loss counts it; 1 for an exact model, 0.96 with the robust loss."""
        return float(np.sqrt(self.cost / self._known))

    @property
    def spread(self) -> float:
        """What a residual adds to the parameters' uncertainty: `rms`, outliers bounded where the loss is robust."""
        if not self.settings.robust:
            return self.rms
        return float(
            np.sqrt(sum(np.sum((_weights(r, self.settings) ** 2 * r) ** 2) for r in self.residuals) / self._known)
        )

    @property
    def _known(self) -> int:
        return max(self.count - self.unknown - len(self.values), 1)


def fit(
    model: Model,
    records: Sequence[Record],
    keys: Sequence[str],
    settings: Settings | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit the parameters ``keys`` of a model to records. ``progress`` gets each step's number and residual over noise.

    Raises `CalibrationError` and `hydraulic_sim.errors.SimulationError`.
    """
    settings = settings or Settings()
    if not records:
        raise CalibrationError("there is no record to calibrate on")
    plant = Plant(model)
    try:
        pieces = cut(records, plant, settings.length, settings.robust)
    except SegmentError as error:
        raise CalibrationError(str(error)) from None
    return fit_pieces(model, plant, pieces, keys, settings, progress)


def fit_pieces(
    model: Model,
    plant: Plant,
    pieces: Sequence[Pieces],
    keys: Sequence[str],
    settings: Settings,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """As `fit`, to pieces that were cut before."""
    values = {k: model.value(k) for k in keys}
    scales = {k: scale(model, k) for k in keys}
    shooting = Shooting(plant, pieces)
    return _minimise(shooting, model, values, scales, settings, progress)


def scale(model: Model, key: str) -> float:
    """The size of a parameter: of its value, or of the library's default where that is larger.

    Where both are 0, as an angle may be, a hundredth of its range.
    """
    parameter = model.parameter(key)
    low, high = parameter.bounds
    return max(abs(model.value(key)), abs(parameter.default)) or 0.01 * (high - low)


def evaluate(model: Model, records: Sequence[Record], settings: Settings | None = None) -> Fit:
    """Residuals of a model as it is: only the pieces' initial states are fitted (for held-out records)."""
    return fit(model, records, (), settings)


def _minimise(
    shooting: Shooting,
    model: Model,
    values: dict[str, float],
    scales: dict[str, float],
    settings: Settings,
    progress: Callable[[int, float], None] | None,
) -> Fit:
    keys = list(values)
    bounds = [model.entry(k).bounds for k in keys]
    damping, converged, step = 1e-3, False, 0
    shooting.misfit = _misfit(shooting, shooting.residuals(values))
    linear = shooting.settle(values)
    cost = _cost(linear, settings)
    information, scores, gradient = _normal(shooting, values, scales, linear, settings)
    for step in range(1, settings.most_steps + 1):
        if not keys:
            linear, cost = _rest(shooting, linear, cost, settings)
            converged = True
            break
        moved = None
        while damping <= _MOST_DAMPING:
            change = bounded_step(information, gradient, values, scales, bounds, damping)
            tried = {k: values[k] + change[i] * scales[k] for i, k in enumerate(keys)}
            before = [s.copy() for s in shooting.starts]
            try:
                trial = shooting.settle(tried)
                new = _cost(trial, settings)
            except SimulationError:  # a step too far: the plant does not run there
                new = np.inf
            if np.isfinite(new) and new < cost:
                moved = (tried, trial, new, float(np.max(np.abs(change))))
                damping = max(damping / 5.0, LEAST_DAMPING)
                break
            shooting.starts = before
            damping *= 8.0
        left = ahead(information, scores, values, scales, bounds)
        if moved is None:
            converged = left < _UPHILL
            break
        gain = (cost - moved[2]) / cost
        values, linear, cost = moved[0], moved[1], moved[2]
        information, scores, gradient = _normal(shooting, values, scales, linear, settings)
        if progress is not None:
            progress(step, float(np.sqrt(cost / max(_count(linear), 1))))
        misfit = _misfit(shooting, [lin.residual for lin in linear])
        if misfit < _NEARER * shooting.misfit:
            shooting.misfit = misfit
            linear = shooting.settle(values)
            cost = _cost(linear, settings)
            information, scores, gradient = _normal(shooting, values, scales, linear, settings)
            continue
        left = ahead(information, scores, values, scales, bounds)
        if gain < settings.least_gain or left < settings.tolerance:
            converged = True
            break
    pieces: list[Pieces] = shooting.pieces
    unknown = sum(len(p.starts) * len(p.free) for p in pieces)
    count = sum(p.measured.size for p in pieces) + unknown  # each start's prior is one more residual
    return Fit(
        values,
        scales,
        converged,
        step,
        cost,
        count,
        unknown,
        information,
        scores,
        [lin.residual for lin in linear],
        shooting,
        settings,
    )


def _misfit(shooting: Shooting, residuals: Sequence[Array]) -> float:
    """How many times the noise the model is off, at least 1, where that matters (see `Shooting`)."""
    if not shooting.guesses:
        return 1.0
    squares = sum(float(np.sum(r[:, : -len(p.free)] ** 2)) for r, p in zip(residuals, shooting.pieces, strict=True))
    return max(1.0, float(np.sqrt(squares / sum(p.measured.size for p in shooting.pieces))))


def _rest(shooting: Shooting, linear: list[Linear], cost: float, settings: Settings) -> tuple[list[Linear], float]:
    """Starts moved on until they rest, where no parameter is fitted: as often as the steps of a fit would."""
    for _ in range(_RESTS):
        before = [s.copy() for s in shooting.starts]
        misfit = _misfit(shooting, [lin.residual for lin in linear])
        if misfit < _NEARER * shooting.misfit:
            shooting.misfit, cost = misfit, np.inf
        again = shooting.settle({})
        new = _cost(again, settings)
        if not new < cost:
            shooting.starts = before
            break
        rested = cost - new < _RESTED * cost
        linear, cost = again, new
        if rested:
            break
    return linear, cost


def _weights(residual: Array, settings: Settings) -> Array:
    if not settings.robust:
        return np.ones_like(residual)
    return 1.0 / np.sqrt(1.0 + (residual / _MILD) ** 2)


def loss(residual: Array, settings: Settings) -> Array:
    """What each residual over noise counts: its square, or with ``robust`` less from about three on (soft L1)."""
    if not settings.robust:
        return residual**2
    return 2.0 * _MILD**2 * (np.sqrt(1.0 + (residual / _MILD) ** 2) - 1.0)


def _cost(linear: Sequence[Linear], settings: Settings) -> float:
    return float(sum(np.sum(loss(lin.residual, settings)) for lin in linear))


def _count(linear: Sequence[Linear]) -> int:
    return sum(lin.residual.size for lin in linear)


def _normal(
    shooting: Shooting,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    linear: Sequence[Linear],
    settings: Settings,
) -> tuple[Array, Array, Array]:
    """Information (P, P), score of every piece (S_total, P) and gradient (P,), starts eliminated."""
    if not scales:
        return np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0)
    jacobians = shooting.jacobian(values, scales, [lin.raw for lin in linear])
    information = np.zeros((len(scales), len(scales)))
    scores = []
    for lin, jacobian in zip(linear, jacobians, strict=True):
        beyond = np.stack([lin.project(jacobian[..., j]) for j in range(jacobian.shape[-1])], axis=-1)
        weighted = beyond * _weights(lin.residual, settings)[..., None]
        flat = weighted.reshape(-1, weighted.shape[-1])
        information += flat.T @ beyond.reshape(flat.shape)
        scores.append(np.einsum("smp,sm->sp", weighted, lin.residual))
    every = np.concatenate(scores)
    return information, every, every.sum(axis=0)
