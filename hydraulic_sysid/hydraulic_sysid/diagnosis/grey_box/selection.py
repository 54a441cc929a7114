"""Which terms a black box needs: forward selection by the error on blocks left out.

In every step the term joins that lowers the squared error most, together with those already in (orthogonal least
squares, [1]); the number of terms is that of the least error on consecutive blocks left out in turn, to within one
standard error of it ([2] section 7.10), because neighbouring samples are alike and a plain criterion would take them
for independent.

[1] S. Chen, S. A. Billings, W. Luo, *Int. J. Control* 50 (1989) 1873–1896.
[2] T. Hastie, R. Tibshirani, J. Friedman, *The Elements of Statistical Learning*, 2nd ed., Springer 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Index, Mask

FOLDS = 5
MOST = 12
_DEPENDENT = 1e-8


@dataclass(frozen=True)
class Selected:
    """Terms in the order in which they joined.

    Their indices, their coefficients, and the mean squared error that as many terms leave on blocks left out.
    """

    order: list[int]
    coefficients: Array
    cross_validated: float

    def predict(self, values: Array) -> Array:
        """The black box's output for terms ``(N, k)``."""
        return values[:, self.order] @ self.coefficients


def select(values: Array, target: Array, blocks: Index, most: int = MOST) -> Selected:
    """Terms for a target ``(N,)`` out of candidates ``(N, k)``; ``blocks`` (N,) numbers the consecutive blocks."""
    folds = blocks % FOLDS
    errors = []
    for fold in range(FOLDS):
        rest, out = folds != fold, folds == fold
        if not out.any() or not rest.any():
            continue
        order = _forward(values[rest], target[rest], most)
        errors.append(_path(values, target, order, rest, out, most))
    error = np.array(errors)
    mean, spread = error.mean(axis=0), error.std(axis=0, ddof=1) / np.sqrt(len(error))
    least = int(np.argmin(mean))
    count = int(np.flatnonzero(mean <= mean[least] + spread[least])[0])
    order = _forward(values, target, most)[:count]
    return Selected(order, _solve(values[:, order], target), float(mean[count]))


def _forward(values: Array, target: Array, most: int) -> list[int]:
    """Terms in the order of what each takes from what the ones before it have left."""
    left, q = target.copy(), values.copy()
    sizes = np.sum(values**2, axis=0)
    order: list[int] = []
    for _ in range(min(most, values.shape[1])):
        now = np.sum(q**2, axis=0)
        usable = now > _DEPENDENT * sizes
        usable[order] = False
        if not usable.any():
            break
        gain = np.where(usable, (q.T @ left) ** 2 / np.where(usable, now, 1.0), -1.0)
        best = int(np.argmax(gain))
        order.append(best)
        unit = q[:, best] / np.sqrt(now[best])
        left = left - unit * (unit @ left)
        q = q - np.outer(unit, unit @ q)
    return order


def _path(values: Array, target: Array, order: list[int], rest: Mask, out: Mask, most: int) -> list[float]:
    """Mean squared error on what was left out, of 0, 1, … ``most`` terms fitted to the rest."""
    errors = [float(np.mean(target[out] ** 2))]
    for count in range(1, most + 1):
        chosen = order[:count]
        coefficients = _solve(values[rest][:, chosen], target[rest])
        errors.append(float(np.mean((target[out] - values[out][:, chosen] @ coefficients) ** 2)))
    return errors


def _solve(values: Array, target: Array) -> Array:
    if not values.shape[1]:
        return np.empty(0)
    return np.asarray(np.linalg.lstsq(values, target, rcond=1e-10)[0], dtype=float)
