"""The independent plant: a servo-hydraulic axis that shares nothing with the project's simulator.

Another solver (`solver`), other laws for the same physics (`laws`), noise and quantisation as on a real bench.
"""

from __future__ import annotations

import numpy as np

from . import experiments, parameters, solver
from . import sensors as instruments

POSITION_NOISE = parameters.NULL["position_noise"]
PRESSURE_NOISE = parameters.NULL["pressure_noise"]
COLUMNS = ("time_s", "command_V", "position_m", "pressure_a_Pa", "pressure_b_Pa")
TRUTH = ("position", "velocity", "pressure_a", "pressure_b", "supply", "tank", "opening")


def run(
    values: dict[str, float],
    feed: np.ndarray,
    rng: np.random.Generator | None = None,
    *,
    centring: float = experiments.CENTRING,
    start: tuple[float, float, float, float] | None = None,
    sensors: instruments.Sensors = instruments.WHITE,
    decimals: int = 6,
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The record and the truth of one experiment.

    values: plant parameters that differ from `parameters.NULL`; feed (n,) V before the feedback of the position,
    which is ``centring`` V/m; rng draws the noise (None: no noise and a fine converter); start: position, velocity,
    pressures (None: at rest, mean pressure of supply and tank); decimals of a recorded position.
    Returns two tables of columns (n,): what was recorded, and the states behind it.
    """
    n = len(feed)
    p = parameters.record(values if rng is not None else {"sensor_step": 1e-12} | values)
    sizes = np.array([p["position_noise"], p["pressure_noise"], p["pressure_noise"]])
    noise = np.zeros((3, n)) if rng is None else instruments.noise(sensors, rng, sizes, n)
    middle = 0.5 * (p["supply"] + p["tank"])
    state = np.array([*(start or (0.0, 0.0, middle, middle)), 0.0])
    out = np.empty((n, 4))
    truth = np.empty((n, len(TRUTH)))
    solver.simulate(p, np.ascontiguousarray(feed, dtype=float), centring, *noise, state, out, truth)
    if not np.isfinite(truth[-1]).all():
        raise FloatingPointError(f"the independent plant diverged with {values}")
    drive, channels = out[:, 0], out[:, 1:].T
    if rng is not None:
        channels = instruments.seen(sensors, rng, channels, noise, sizes, float(p["supply"]))
        if p["spike_share"] > 0.0:
            place = int(p["spike_channel"])
            instruments.spiked(channels[place], rng, p["spike_share"], p["spike_size"] * sizes[place])
    drive = instruments.late(drive, round(float(p["drive_late"])))
    position, *pressures = channels
    pressures = [instruments.late(row, round(float(p["pressures_late"]))) for row in pressures]
    if rng is not None:
        drive, position = drive.round(4), position.round(decimals)
        pressures = [row.round() for row in pressures]
    time = np.arange(n) / experiments.RATE
    recorded = [time, drive, position, *pressures]
    return dict(zip(COLUMNS, recorded, strict=True)), dict(zip(TRUTH, truth.T, strict=True))
