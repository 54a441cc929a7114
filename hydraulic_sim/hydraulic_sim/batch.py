"""Many simulations at once, over all cores: parameter sets, records, Monte Carlo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_node_utils import processors

from .errors import ModelError
from .model import Model
from .plant import Plant, PlantState, Trajectory


@dataclass(frozen=True)
class Job:
    """One simulation: the plant, its drive (N,) [V], the sampling interval [s] and where it starts."""

    plant: Plant
    drive: ArrayLike
    dt: float
    initial: PlantState | None = None


def simulate_batch(jobs: Sequence[Job], workers: int | None = None) -> list[Trajectory]:
    """Simulate all jobs and return their trajectories in order: bit for bit what one by one gives.

    The compiled plant holds no lock, so threads use every core.

    :raises SimulationError: a job fails; the first error is raised.
    """
    count = workers or processors.usable()
    if count == 1 or len(jobs) < 2:
        return [_run(job) for job in jobs]
    with ThreadPoolExecutor(max_workers=min(count, len(jobs))) as pool:
        return list(pool.map(_run, jobs))


def _run(job: Job) -> Trajectory:
    return job.plant.simulate(job.drive, job.dt, job.initial)


def scatter(model: Model, relative: Mapping[str, float], count: int, seed: int) -> list[Model]:
    """``count`` copies of a model with scattered parameters, for Monte Carlo studies.

    ``relative``: key → standard deviation relative to the model's value; drawn normal, cut at three deviations and
    at the library's bounds. The same seed gives the same models.

    :raises ModelError: an unknown key or a negative deviation.
    """
    for key, deviation in relative.items():
        model.parameter(key)
        if not deviation >= 0.0:
            raise ModelError(f"scatter of {key}: the relative deviation {deviation} is negative")
    generator = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        values = {}
        for key, deviation in relative.items():
            low, high = model.parameter(key).bounds
            factor = 1.0 + deviation * float(np.clip(generator.standard_normal(), -3.0, 3.0))
            values[key] = float(np.clip(model.value(key) * factor, low, high))
        made.append(model.with_values(values))
    return made
