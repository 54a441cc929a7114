"""Root mean square error of linear models on periodic drives that they were not fitted to.

Shapes × amplitudes × frequencies, against the nonlinear plant: shows where a linear model holds and where not. The
same table over measured records is `records_rmse`. Every model runs free, at its own sampling time, from the initial
state that fits best.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from scipy import signal

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.resampling import held_average, sampled
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.errors import IdentificationError
from hydraulic_sysid.linear.models.model import LinearModel

SHAPES: dict[str, Callable[[Array], Array]] = {
    "triangle": lambda phase: signal.sawtooth(phase + 0.5 * np.pi, 0.5),
    "square": signal.square,
    "sine": np.sin,
    "sawtooth": lambda phase: signal.sawtooth(phase + np.pi),
}
"""Name → value in −1 … 1 at a phase [rad]; all begin their period rising, with mean zero."""


@dataclass(frozen=True)
class Grid:
    """What is tried: drives of these ``shapes``, ``amplitudes`` [V] and ``frequencies`` [Hz]."""

    amplitudes: Sequence[float]
    frequencies: Sequence[float]
    shapes: Sequence[str] = tuple(SHAPES)
    periods: int = 5
    shortest: float = 5.0
    """Seconds that every drive lasts at least, in whole periods."""

    def __post_init__(self) -> None:
        unknown = [s for s in self.shapes if s not in SHAPES]
        if unknown:
            raise IdentificationError(f"shape {unknown[0]!r} is none of {', '.join(SHAPES)}")
        for name, values in (("amplitude", self.amplitudes), ("frequency", self.frequencies)):
            for value in values:
                if not (np.isfinite(value) and value > 0.0):
                    raise IdentificationError(f"{name} {value:g} must be positive")


def periodic(shape: str, amplitude: float, frequency: float, duration: float, dt: float) -> Array:
    """A drive ``(N,)`` [V] of one of `SHAPES`, sampled every ``dt`` seconds."""
    # A hair into each sample, so that rounding does not decide on which side of an edge it lies.
    t: Array = dt * (np.arange(round(duration / dt), dtype=np.float64) + 1e-6)
    return amplitude * SHAPES[shape](2.0 * np.pi * frequency * t)


def rmse_grid(models: Mapping[str, LinearModel], plant: Plant, grid: Grid, dt: float = 1e-3) -> list[dict[str, Any]]:
    """One entry per drive: what it was, whether the plant stayed off its stops, and the errors of every model.

    ``shape``, ``amplitude`` [V], ``frequency`` [Hz], ``duration`` [s], ``std`` (standard deviation of the plant's
    position [m]), ``within_travel``, and ``models``: name → ``rmse`` [m], ``best_fit`` [%] (NaN for an unstable
    model). The plant starts at rest, where the drive's mean motion is centred in the stroke.
    """
    cells = []
    for shape, amplitude, frequency in product(grid.shapes, grid.amplitudes, grid.frequencies):
        duration = max(grid.periods, int(np.ceil(grid.shortest * frequency))) / frequency
        drive = periodic(shape, amplitude, frequency, duration, dt)
        position, inside = _centred(plant, drive, dt)
        cells.append(
            {
                "shape": shape,
                "amplitude": float(amplitude),
                "frequency": float(frequency),
                "duration": duration,
                "std": float(np.std(position)),
                "within_travel": inside,
                "models": {name: errors(model, drive, position, dt) for name, model in models.items()},
            }
        )
    return cells


def records_rmse(
    models: Mapping[str, LinearModel],
    records: Sequence[Record],
    input_channel: str = "drive",
    output_channel: str = "position",
) -> list[dict[str, Any]]:
    """The same over measured records: ``name``, ``duration``, ``std`` and ``models`` as of `rmse_grid`."""
    return [
        {
            "name": record.name,
            "duration": record.duration,
            "std": float(np.std(record[output_channel])),
            "models": {
                name: errors(model, record[input_channel], record[output_channel], record.dt)
                for name, model in models.items()
            },
        }
        for record in records
    ]


def errors(model: LinearModel, drive: Array, output: Array, dt: float) -> dict[str, float]:
    """``rmse`` (the output's unit) and ``best_fit`` [%] of a model's free run, NaN where it cannot be run."""
    u, y = held_average(drive, dt, model.dt), sampled(output, dt, model.dt)
    free = model.simulate(u, y)
    if not np.isfinite(free).all():
        return {"rmse": float("nan"), "best_fit": float("nan")}
    return {"rmse": metrics.rmse(y, free), "best_fit": metrics.best_fit(y, free)}


def _centred(plant: Plant, drive: Array, dt: float) -> tuple[Array, bool]:
    """The plant's position, started so that its motion lies around mid stroke; whether it stayed off the stops."""
    half = 0.5 * plant.value("stroke")
    try:
        first = plant.simulate(drive, dt).true_position
        start = float(np.clip(-0.5 * (first.max() + first.min()), -0.99 * half, 0.99 * half))
        run = plant.simulate(drive, dt, plant.initial_state(position=start, drive=float(drive[0])))
    except SimulationError as error:
        raise SimulationError(f"RMSE grid, drive of {np.max(np.abs(drive)):g} V: {error}") from None
    return run.position, bool(np.abs(run.true_position).max() < half)
