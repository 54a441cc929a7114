"""Searches for the least of a cost, by name: what `tune` may use. All count the same trials of the same cost.

Each moves from 0 in as many dimensions as the cost has; one unit is a factor e of a gain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution as scipy_differential_evolution
from scipy.optimize import minimize

Array = NDArray[np.float64]
SPAN = 1.6
"""Half the range in which a population is scattered: gains from a fifth to five times their start."""
_POPULATION = 12
_INERTIA, _PULL = 0.7298, 1.49618


class Objective:
    """A cost that counts its trials and keeps its best point; it begins from what the origin costs."""

    def __init__(self, cost: Callable[[Array], float], size: int, lowest: float) -> None:
        self._cost, self.size, self.lowest = cost, size, lowest
        self.best: Array = np.zeros(size)
        self.trials = 1

    def __call__(self, x: Array) -> float:
        """The cost at ``x`` (size,)."""
        self.trials += 1
        found = self._cost(x)
        if found < self.lowest:
            self.best, self.lowest = np.array(x, dtype=float), found
        return found


def nelder_mead(objective: Objective, trials: int, seed: int) -> None:
    """The simplex of Nelder and Mead (scipy), begun twice: that frees one that has shrunk too early; no chance."""
    steps = np.where(np.arange(objective.size) % 2, 0.7, 0.5)
    for share in (0.6, 0.4):
        origin = objective.best
        simplex = np.vstack([origin, origin + np.diag(steps)])
        options = {"initial_simplex": simplex, "maxfev": round(share * trials), "adaptive": True, "fatol": 1e-4}
        minimize(objective, origin, method="Nelder-Mead", options=options)


def particle_swarm(objective: Objective, trials: int, seed: int) -> None:
    """A swarm that is drawn to the best point of each and of all, one of it at the start.

    J. Kennedy, R. Eberhart, Proc. IEEE Int. Conf. Neural Networks 1995; coefficients: M. Clerc, J. Kennedy, IEEE
    Trans. Evolutionary Computation 6 (2002).
    """
    chance = np.random.default_rng(seed)
    x = _scattered(objective.size, chance)
    v = 0.5 * (_scattered(objective.size, chance) - x)
    own, costs = x.copy(), np.array([objective.lowest, *map(objective, x[1:])])
    for _ in range(trials // _POPULATION - 1):
        pulls = _PULL * chance.random((2, *x.shape))
        v = _INERTIA * v + pulls[0] * (own - x) + pulls[1] * (own[np.argmin(costs)] - x)
        x = x + v
        found = np.array([objective(one) for one in x])
        better = found < costs
        own[better], costs[better] = x[better], found[better]


def differential_evolution(objective: Objective, trials: int, seed: int) -> None:
    """R. Storn, K. Price, J. Global Optimization 11 (1997), by scipy, with the start in the first population."""
    bounds = [(-2.0 * SPAN, 2.0 * SPAN)] * objective.size
    first = _scattered(objective.size, np.random.default_rng(seed))
    generations = max(trials // _POPULATION - 1, 1)
    scipy_differential_evolution(
        objective, bounds, init=first, maxiter=generations, tol=0.0, polish=False, seed=np.random.default_rng(seed + 1)
    )


def _scattered(size: int, chance: np.random.Generator) -> Array:
    """A population (n, size) of which the first is the start."""
    found = chance.uniform(-SPAN, SPAN, (_POPULATION, size))
    found[0] = 0.0
    return found


OPTIMISERS: dict[str, Callable[[Objective, int, int], None]] = {
    one.__name__: one for one in (nelder_mead, particle_swarm, differential_evolution)
}
"""By name: ``optimise(objective, trials, seed)``; the same seed gives the same."""
