"""Speed of the ARX fit on a million samples, against the same problem bare in numpy, in one run.

    ./bench shell -- python benchmarks/arx_speed.py

Three ways to the same parameters of ARX(3, 3, 1) with a constant: `fit_arx` (checks, standard errors, condition
number), `numpy.linalg.lstsq` on the regression matrix, and the normal equations. The bare ways are timed with and
without building their matrix. Exits with 1 if `fit_arx` takes more than 0.5 s, or more than three times the faster bare
way with its matrix built.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.signal import lfilter

from hydraulic_sysid.linear.models import ArxOrder, fit_arx

SAMPLES = 1_000_000
ORDER = ArxOrder(3, 3, 1)
LONGEST, MOST = 0.5, 3.0


def best_of(function, repeats: int = 7) -> float:
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def build(u: np.ndarray, y: np.ndarray) -> np.ndarray:
    n, first = y.size, ORDER.memory
    outputs = [-y[first - i : n - i] for i in range(1, ORDER.na + 1)]
    inputs = [u[first - i : n - i] for i in range(ORDER.nk, ORDER.nk + ORDER.nb)]
    return np.column_stack([*outputs, *inputs, np.ones(n - first)])


def normal(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    return np.linalg.solve(matrix.T @ matrix, matrix.T @ target)


def squares(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(matrix, target, rcond=None)[0]


def main() -> int:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(SAMPLES)
    y = lfilter([0.0, 0.1, 0.2, 0.1], [1.0, -1.5, 0.7, -0.1], u) + 0.01 * rng.standard_normal(SAMPLES)
    matrix, target = build(u, y), y[ORDER.memory :]
    model = fit_arx([u], [y], 1e-3, ORDER)
    ours = best_of(lambda: fit_arx([u], [y], 1e-3, ORDER))
    found = np.array([*model.a, *model.b, model.constant])
    rows = [
        ("lstsq, matrix given", best_of(lambda: squares(matrix, target)), squares(matrix, target)),
        ("lstsq", best_of(lambda: squares(build(u, y), target)), squares(matrix, target)),
        ("normal equations, matrix given", best_of(lambda: normal(matrix, target)), normal(matrix, target)),
        ("normal equations", best_of(lambda: normal(build(u, y), target)), normal(matrix, target)),
    ]
    print(f"{ORDER.text} with a constant, {SAMPLES} samples; one process; best of 7")
    print(f"{'fit_arx':32s} {ours * 1e3:8.1f} ms")
    for name, seconds, theta in rows:
        far = np.abs(theta - found).max()
        print(f"{name:32s} {seconds * 1e3:8.1f} ms   fit_arx takes {ours / seconds:5.2f} times, {far:.1e} apart")
    bare = min(seconds for name, seconds, _ in rows if "given" not in name)
    return 0 if ours <= LONGEST and ours <= MOST * bare else 1


if __name__ == "__main__":
    sys.exit(main())
