"""State-space models by a subspace method: past-input past-output MOESP, with N4SID's states for the noise model.

1. Block rows of past and future inputs and outputs, one column per instant; their LQ factors (here R of the
   transposed rows, so that records of any length and number can be taken in).
2. The part of the future outputs that the past explains beyond the future inputs; its singular vectors span the
   observability matrix, [1] section 4.3 (MOESP's weighting).
3. A and C from the observability matrix and its shift by one sample.
4. B, D, offsets and initial states by least squares on the simulated output, which is linear in them.
5. The states at every instant from the past (N4SID), and from them the gain of the innovations, [1] section 4.4.

[1] P. Van Overschee, B. De Moor, *Subspace Identification for Linear Systems*, Kluwer 1996.
[2] M. Verhaegen, *Automatica* 30 (1994) 61–74.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, solve_discrete_are

from hydraulic_sim.arrays import Array
from hydraulic_sysid.linear.errors import IdentificationError

from .experiments import experiments
from .state_recursion import propagate
from .state_space import StateSpaceModel, free_modes
from .tall_least_squares import triangle

Pairs = Sequence[tuple[Array, Array]]
_HORIZON = 15
_RELATIVE = 1e-12
_MOST_WORK = 3e9  # samples times columns squared: about a second


@dataclass(frozen=True)
class Subspace:
    """Observability matrix ``(i, i)`` with its ``singular_values``; one is computed for all orders.

    The weights ``(i, 2i)`` on the past give its coordinates.
    """

    vectors: Array
    singular_values: Array
    past_weights: Array
    horizon: int


def fit_state_space(
    drives: Sequence[ArrayLike],
    outputs: Sequence[ArrayLike],
    dt: float,
    order: int,
    *,
    horizon: int | None = None,
    direct: bool = False,
    offsets: str = "estimate",
) -> StateSpaceModel:
    """State-space model with ``order`` states of one or several experiments, sampled alike every ``dt`` seconds.

    ``horizon``: samples of past and of future that are looked at, more than ``order``; by default the best of three
    in simulation. ``direct`` lets the input act on the output without delay; ``offsets`` as of `arx.fit_arx`.

    :raises IdentificationError: too few samples, unequal lengths, an input that does not excite the order.
    """
    pairs, u0, y0 = experiments(drives, outputs, offsets)
    if order < 1:
        raise IdentificationError(f"order {order}: at least one state is needed")
    if horizon is not None and horizon <= order:
        raise IdentificationError(f"a horizon of {horizon} samples must exceed the order {order}")
    problem: IdentificationError | None = None
    fitted: list[StateSpaceModel] = []
    for i in [horizon] if horizon is not None else _horizons(order, sum(u.size for u, _ in pairs)):
        try:
            fitted.append(_fit(pairs, dt, order, i, direct, offsets))
        except IdentificationError as error:
            problem = problem or error
    if not fitted:
        assert problem is not None
        raise problem
    best = min(fitted, key=lambda m: m.loss)
    best = replace(best, input_offset=u0, output_offset=y0)
    left = [y + y0 - best.predict(u + u0, y + y0) for u, y in pairs]
    return replace(best, one_step_loss=float(np.mean(np.concatenate(left) ** 2)))


def _horizons(order: int, samples: int) -> list[int]:
    """The shortest usual horizon, and its double and fourfold as far as record and patience allow."""
    first = max(_HORIZON, 3 * order)
    return [first, *(i for i in (2 * first, 4 * first) if 20 * i < samples and samples * (4 * i) ** 2 < _MOST_WORK)]


def _fit(pairs: Pairs, dt: float, order: int, horizon: int, direct: bool, offsets: str) -> StateSpaceModel:
    subspace = project(pairs, horizon, offsets == "estimate")
    if subspace.singular_values[order - 1] < _RELATIVE * subspace.singular_values[0]:
        rank = int(np.sum(subspace.singular_values > _RELATIVE * subspace.singular_values[0]))
        raise IdentificationError(f"the record holds no more than {rank} states: lower the order {order}")
    gamma = subspace.vectors[:, :order] * np.sqrt(subspace.singular_values[:order])
    A = np.linalg.lstsq(gamma[:-1], gamma[1:], rcond=None)[0]
    C = gamma[0].copy()
    model = _with_inputs(A, C, pairs, dt, direct, offsets == "estimate")
    gain = _innovations_gain(model, subspace, gamma, pairs)
    return replace(model, K=gain, singular_values=subspace.singular_values, horizon=horizon)


def project(pairs: Pairs, horizon: int, constant: bool) -> Subspace:
    """What the past says about the future outputs beyond the future inputs and, where asked for, a constant.

    :raises IdentificationError: too few samples for the horizon, or an input that is not rich enough.
    """
    if sum(max(u.size - 2 * horizon + 1, 0) for u, _ in pairs) < 8 * horizon:
        samples = sum(u.size for u, _ in pairs)
        raise IdentificationError(f"{samples} samples are too few for a horizon of {horizon}: take {10 * horizon}")
    r, _ = triangle(_rows(pairs, horizon, constant))
    i, known = horizon, horizon + int(constant)
    future_inputs = np.abs(np.diag(r)[int(constant) : known])
    if future_inputs.min() < _RELATIVE * future_inputs.max():
        raise IdentificationError(f"the input is not rich enough for a horizon of {i} samples: use a richer one")
    # Rows of r: constant, future inputs, past, future outputs; L32 is its block of past and future outputs, transposed.
    there = slice(known, known + 2 * i)
    past, explained = r[there, there], r[there, known + 2 * i :]
    vectors, singular, _ = np.linalg.svd(explained.T, full_matrices=False)
    weights: Array = np.asarray(np.linalg.lstsq(past, explained, rcond=_RELATIVE)[0].T, dtype=float)
    return Subspace(vectors, singular, weights, horizon)


def _rows(pairs: Pairs, i: int, constant: bool) -> Iterator[list[Array]]:
    """Columns of 1, future inputs, past inputs and outputs, future outputs; one row per instant."""
    for u, y in pairs:
        n = u.size - 2 * i + 1
        if n > 0:
            future = [u[i + k : i + k + n] for k in range(i)]
            first = [np.ones(n)] if constant else []
            yield [*first, *future, *_past(u, y, i, n), *(y[i + k : i + k + n] for k in range(i))]


def _past(u: Array, y: Array, i: int, n: int) -> list[Array]:
    return [*(u[k : k + n] for k in range(i)), *(y[k : k + n] for k in range(i))]


def _with_inputs(A: Array, C: Array, pairs: Pairs, dt: float, direct: bool, constant: bool) -> StateSpaceModel:
    """B, D and f with the initial states that simulate the outputs best."""
    order = C.size
    transposed = np.ascontiguousarray(A.T)
    own, shared = [], []
    with np.errstate(over="ignore", invalid="ignore"):
        for u, _ in pairs:
            parts = [propagate(transposed, np.outer(u, C), np.zeros(order))]
            if constant:
                parts.append(propagate(transposed, np.tile(C, (u.size, 1)), np.zeros(order)))
            shared.append(np.column_stack([*parts, u] if direct else parts))
            own.append(free_modes(A, C, u.size))
    columns = np.hstack((np.vstack(shared), block_diag(*own)))
    if not np.isfinite(columns).all() or np.abs(columns).max() > 1e100:
        raise IdentificationError("the model is too unstable to be simulated: change the order or the horizon")
    lengths = np.linalg.norm(columns, axis=0)
    lengths[lengths == 0.0] = 1.0
    target = np.concatenate([y for _, y in pairs])
    # With offsets the columns are dependent (a constant is a free response too): the least of the solutions is taken.
    scaled, *_ = np.linalg.lstsq(columns / lengths, target, rcond=1e-11)
    theta = scaled / lengths
    loss = float(np.mean((target - columns @ theta) ** 2))
    return StateSpaceModel(
        dt=dt,
        A=A,
        B=theta[:order],
        C=C,
        D=float(theta[order * (1 + int(constant))]) if direct else 0.0,
        K=np.zeros(order),
        constant=theta[order : 2 * order] if constant else np.zeros(order),
        input_offset=0.0,
        output_offset=0.0,
        singular_values=np.empty(0),
        horizon=0,
        loss=loss,
        one_step_loss=loss,
        samples=target.size,
        constants=int(constant),
        direct=direct,
    )


def _innovations_gain(model: StateSpaceModel, subspace: Subspace, gamma: Array, pairs: Pairs) -> Array:
    """Stationary Kalman gain from the covariances of what the states at two instants leave over.

    Zero where the data have no such gain (no noise to speak of, or a model on the border of stability).
    """
    i, order = subspace.horizon, model.order
    to_state = np.linalg.pinv(gamma) @ subspace.past_weights
    left = []
    for u, y in pairs:
        n = u.size - i
        states = np.column_stack(_past(u, y, i, n)) @ to_state.T
        known = np.column_stack((states, u[i : i + n], np.ones(n)))[:-1]
        following = np.column_stack((states[1:], y[i : i + n - 1]))
        left.append(following - known @ np.linalg.lstsq(known, following, rcond=None)[0])
    errors = np.vstack(left)
    covariance = errors.T @ errors / len(errors)
    Q, S, R = covariance[:order, :order], covariance[:order, order:], covariance[order:, order:]
    try:
        P = solve_discrete_are(model.A.T, model.C[:, None], Q, R, s=S)
        gain = (model.A @ P @ model.C + S[:, 0]) / (model.C @ P @ model.C + R[0, 0])
    except (np.linalg.LinAlgError, ValueError):
        return np.zeros(order)
    stable = np.isfinite(gain).all() and np.abs(np.linalg.eigvals(model.A - np.outer(gain, model.C))).max() < 1.0
    return gain if stable else np.zeros(order)
