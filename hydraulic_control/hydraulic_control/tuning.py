"""Optimisation of the gains on the nonlinear plant, its scattered copies and the identified models."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydraulic_control.controller import Controller
from hydraulic_control.errors import ControlError
from hydraulic_control.optimisers import OPTIMISERS, Objective
from hydraulic_control.parameters import SPECS
from hydraulic_control.response import Response, StepFigures, step_figures
from hydraulic_control.scenario import Case
from hydraulic_control.simulation import BEGIN_S, run, step_reference
from hydraulic_node_utils import processors

FORCE = "force_feedback"
"""Tuned of every law, beside what the law names."""

FLOOR = {"ki": 1.0, "kd": 1e-3, "force_feedback": 1e-8, "k1": 0.05, "k2": 1.0}
"""Where the search begins for a gain that starts at 0: it moves on a logarithmic scale. Others: a hundredth of their
default."""

_HOPELESS = 10.0
_WITHIN = 0.1


@dataclass(frozen=True)
class Criteria:
    """Goals of a step: rise and settling time [s], overshoot [%], steady-state error [m], speed of the drive [V/s].

    The cost of a step is the mean of its figures over their goals, a tenth of what lies within the goal and all beyond
    it: first all goals are met, then each is bettered. ``ise`` is the goal of the integral of the squared error, over
    the square of the step [s]. ``agreement`` is how far rise and settling time of an identified model may lie from the
    plant's, and its overshoot in terms of the goal: gains that rely on what the model does not know are avoided. The
    cost of gains is half the mean and half the worst over the plants, so that no plant is given up.
    """

    rise: float = 0.2
    settling: float = 0.5
    overshoot: float = 1.0
    steady_state: float = 1e-5
    activity: float = 200.0
    ise: float = 0.15
    agreement: float = 0.1

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise ControlError(f"criterion {name} is {value:g}; it must be positive and finite")

    def cost(self, figures: StepFigures, step: float) -> float:
        """Of one step of ``step`` [m]; a tenth where the goals are just met, never more than `_HOPELESS` a figure."""
        return self._mean([
            figures.rise_time / self.rise,
            figures.settling_time / self.settling,
            figures.overshoot / self.overshoot,
            figures.steady_state_error / self.steady_state,
            figures.activity / self.activity,
            figures.ise / (step**2 * self.ise),
        ])  # fmt: skip

    def disagreement(self, figures: StepFigures, plant: StepFigures) -> float:
        """Cost of what an identified model says otherwise than the plant."""
        return self._mean([
            abs(figures.rise_time / plant.rise_time - 1.0) / self.agreement,
            abs(figures.settling_time / plant.settling_time - 1.0) / self.agreement,
            abs(figures.overshoot - plant.overshoot) / (self.agreement * self.overshoot),
        ])  # fmt: skip

    @staticmethod
    def _mean(ratios: Sequence[float]) -> float:
        parts = [_WITHIN * x + (1.0 - _WITHIN) * max(x - 1.0, 0.0) if math.isfinite(x) else _HOPELESS for x in ratios]
        return float(np.mean(np.minimum(parts, _HOPELESS)))


@dataclass(frozen=True)
class Tuned:
    """The values found, their cost, that of the start, and how many times they were tried."""

    values: dict[str, Any]
    cost: float
    start_cost: float
    trials: int


def try_step(values: Mapping[str, Any], case: Case, step: float, duration: float) -> Response:
    """The response to a step of ``step`` [m], which comes after a second of rest."""
    return run(case.plant, Controller(values), step_reference(step, at=BEGIN_S), duration + BEGIN_S)


def figures_of(response: Response) -> StepFigures | None:
    """Figures of a step; None where the plant ran away."""
    return None if response.ran_away else step_figures(response)


def cost_of(
    values: Mapping[str, Any], cases: Sequence[Case], steps: Sequence[float], criteria: Criteria, duration: float
) -> float:
    """Cost of these values over all plants, of which the first is the model as it is, and steps [m]."""
    Controller(values)  # refuses values that are not allowed, and is compiled once, before the threads
    with ThreadPoolExecutor(processors.usable()) as pool:
        tried = [[pool.submit(try_step, values, case, step, duration) for case in cases] for step in steps]
    costs = []
    for step, responses in zip(steps, tried, strict=True):
        plant: StepFigures | None = None
        for i, (case, response) in enumerate(zip(cases, responses, strict=True)):
            figures = figures_of(response.result())
            cost = _HOPELESS if figures is None else criteria.cost(figures, step)
            if i == 0:
                plant = figures
            elif case.identified and figures is not None and plant is not None:
                cost += criteria.disagreement(figures, plant)
            costs.append(cost)
    return 0.5 * float(np.mean(costs)) + 0.5 * max(costs)


def optimise(
    start: Mapping[str, Any],
    cases: Sequence[Case],
    steps: Sequence[float],
    criteria: Criteria,
    free: Sequence[str] | None = None,
    duration: float = 1.5,
    trials: int = 300,
    optimiser: str = "nelder_mead",
    seed: int = 0,
) -> Tuned:
    """Better values than ``start`` for those that are free (by default what its law names), searched for in logarithms.

    :param optimiser: one of `optimisers.OPTIMISERS`
    :param seed: of its chance
    :raises ControlError: a start or free names that are not allowed.
    """
    tuned = (*Controller(start).law.tuned, FORCE)
    names = tuple(tuned if free is None else free)
    for name in names:
        if name not in SPECS or not isinstance(SPECS[name].default, float):
            raise ControlError(f"{name!r} cannot be optimised; numbers are {', '.join(tuned)} …")
    first = {name: max(float(start.get(name, SPECS[name].default)), _floor(name)) for name in names}
    before = cost_of(start, cases, steps, criteria, duration)

    def values_at(x: np.ndarray) -> dict[str, Any]:
        return dict(start) | {n: _inside(n, first[n] * math.exp(v)) for n, v in zip(names, x.tolist(), strict=True)}

    def cost(x: np.ndarray) -> float:
        try:
            return cost_of(values_at(x), cases, steps, criteria, duration)
        except ControlError:  # poles that its period cannot have
            return 2.0 * _HOPELESS

    objective = Objective(cost, len(names), before)
    if trials:
        OPTIMISERS[optimiser](objective, trials, seed)
    better = objective.lowest < before
    return Tuned(values_at(objective.best) if better else dict(start), objective.lowest, before, objective.trials)


def best_start(
    candidates: Sequence[Mapping[str, Any]],
    cases: Sequence[Case],
    steps: Sequence[float],
    criteria: Criteria,
    duration: float = 1.5,
) -> Mapping[str, Any]:
    """The candidate of least cost."""
    return min(candidates, key=lambda values: cost_of(values, cases, steps, criteria, duration))


def _floor(name: str) -> float:
    return FLOOR.get(name, max(0.01 * float(SPECS[name].default), 1e-9))


def _inside(name: str, value: float) -> float:
    spec = SPECS[name]
    low = 0.0 if spec.minimum is None else spec.minimum
    high = math.inf if spec.maximum is None else spec.maximum
    return min(max(value, low), high)
