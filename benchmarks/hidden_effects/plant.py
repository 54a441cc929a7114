"""The independent plant: a servo-hydraulic axis that shares nothing with the project's simulator.

Another solver (`solver`), other laws for the same physics (`laws`), noise and quantisation as on a real bench.
"""

from __future__ import annotations

import numpy as np

from . import experiments, parameters, solver

POSITION_NOISE = 20e-6  # m, before the converter
PRESSURE_NOISE = 15e3  # Pa
COLUMNS = ("time_s", "command_V", "position_m", "pressure_a_Pa", "pressure_b_Pa")
TRUTH = ("position", "velocity", "pressure_a", "pressure_b", "supply", "tank", "opening")


def run(
    values: dict[str, float],
    feed: np.ndarray,
    rng: np.random.Generator | None = None,
    *,
    centring: float = experiments.CENTRING,
    start: tuple[float, float, float, float] | None = None,
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The record and the truth of one experiment.

    values: plant parameters that differ from `parameters.NULL`; feed (n,) V before the centring feedback; rng draws
    the noise (None: no noise and a fine converter); start: position, velocity, pressures (None: at rest, mean
    pressure of supply and tank).
    Returns two tables of columns (n,): what was recorded, and the states behind it.
    """
    n = len(feed)
    p = parameters.record(values if rng is not None else {"sensor_step": 1e-12} | values)
    noise = np.zeros((3, n))
    if rng is not None:
        noise = rng.standard_normal((3, n)) * np.array([[POSITION_NOISE], [PRESSURE_NOISE], [PRESSURE_NOISE]])
    middle = 0.5 * (p["supply"] + p["tank"])
    state = np.array([*(start or (0.0, 0.0, middle, middle)), 0.0])
    out = np.empty((n, 4))
    truth = np.empty((n, len(TRUTH)))
    solver.simulate(p, np.ascontiguousarray(feed, dtype=float), centring, *noise, state, out, truth)
    if not np.isfinite(truth[-1]).all():
        raise FloatingPointError(f"the independent plant diverged with {values}")
    time = np.arange(n) / experiments.RATE
    recorded = [time, *out.T]
    if rng is not None:
        recorded = [time, out[:, 0].round(4), out[:, 1].round(6), out[:, 2].round(), out[:, 3].round()]
    return dict(zip(COLUMNS, recorded, strict=True)), dict(zip(TRUTH, truth.T, strict=True))
