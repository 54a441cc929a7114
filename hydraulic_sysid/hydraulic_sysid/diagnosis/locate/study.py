"""One record studied: its balances beside those of its twin, and the moments by which blame is judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.compare.channels import Measured, measured
from hydraulic_sysid.diagnosis.compare.prediction import start
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

from .balances import Balances, Residuals
from .blame import PARAMETERS
from .directions import Family, families, turning
from .knots import Knots
from .lines import waves
from .moments import Moments
from .noise_model import Whitener, thin, thinning
from .path import path_of
from .sensors import SensorErrors, sensor_errors
from .signals import Signals, signals_of, smoothed, smoothing_windows

_SENSED = ("position", "pressure_a", "pressure_b", "pressure_supply", "spool")
_EDGE = 0.1  # s at either end of a record, where smoothing filters have one side only
_STEP = 1e-3  # difference step of a parameter, of its size


@dataclass(frozen=True)
class Side:
    """Balances of a record or of its twin: formed ``(B, n)``, thinned and whitened ``(B, m)``, and signals."""

    formed: Residuals
    white: Array
    signals: Signals


@dataclass(frozen=True)
class Study:
    """A record and its twin. ``moved`` (P, B, m): what its parameters do to its balances, whitened, per change by their
    size."""

    data: Measured
    names: tuple[str, ...]
    own: Side
    twin: Side
    whitener: Whitener
    factor: int
    moved: Array

    @property
    def rate(self) -> float:
        """Thinned samples per second."""
        return 1.0 / (self.factor * self.data.record.dt)


def study(balances: Balances, record: Record, names: tuple[str, ...], keys: Sequence[str], seed: int) -> Study:
    """Form ``names`` of a record; ``keys`` are the parameters that may move. The twin's noise is drawn by ``seed``."""
    plant = balances.plant
    data = measured(record, balances.model)
    filter_ = data.velocity_filter
    dt, factor = record.dt, thinning(record.dt)
    free = plant.simulate(record["drive"], dt, start(plant, data))
    errors = sensor_errors(balances.model, plant, free)
    own = {n: v for n, v in data.channels.items() if n in _SENSED or n == "drive"}
    rng = np.random.default_rng(seed)
    clean = {**own, **{n: free[n] for n in own if n != "drive"}}
    # Noise drawn a second time makes the whitener: the twin's own would look whiter to it than the record's can.
    noisy, other = (
        {n: v if n == "drive" else v + data.noise[n] * rng.standard_normal(v.size) for n, v in clean.items()}
        for _ in range(2)
    )
    formed, bare, twin, again = (balances.form(c, dt, names, filter_, errors) for c in (own, clean, noisy, other))
    whitener = Whitener.of(thin(again.values - bare.values, factor))
    windows = smoothing_windows(own, data.noise, dt)
    still = {**own, **smoothed({n: v for n, v in own.items() if n in _SENSED}, windows)}
    moved = _parameters(balances, still, dt, names, filter_, errors, keys)
    sides: dict[str, Side] = {}
    for which, channels, residuals in (("own", own, formed), ("twin", noisy, twin)):
        read = errors.corrected(channels)
        none = np.full(len(record), np.nan)
        x, pa, pb = read["position"], read.get("pressure_a", none), read.get("pressure_b", none)
        path = path_of(plant, record["drive"], dt, x, filter_(x), pa, pb, residuals.values.shape[1])
        signals = signals_of(
            plant, read, record["drive"], dt, residuals, filter_, data.noise["velocity"], path, windows
        )
        sides[which] = Side(residuals, whitener(thin(residuals.values, factor)), signals)
    thinned = whitener(thin(moved, factor))
    return Study(data, names, sides["own"], sides["twin"], whitener, factor, thinned)


def moments(
    s: Study, side: Side, knots: Knots, lines: Sequence[float], record: int, records: int
) -> tuple[Moments, list[str], list[str]]:
    """Moments of one side, and the subsystem and the variable of every direction.

    ``lines``: frequencies [Hz] that most records show; the study is the ``record``-th of ``records``.
    """
    names = s.names
    subsystems, variables, found = [], [], []
    shapes = families(side.signals, names, knots, waves(lines, side.signals.time, record, records))
    for parts, subsystem, over in map(lambda family: _thinned(s, family), shapes):  # which keeps no family alive
        found += parts
        subsystems += [subsystem] * len(over)
        variables += over
    turns = np.zeros((0, *s.moved.shape[1:]))
    if "force" in names:
        turns = s.whitener(thin(turning(side.signals, s.data.noise["position"])[:, None], s.factor), (0,))
    given = np.concatenate((s.moved, turns))
    edge = max(1, int(round(_EDGE * s.rate)))
    made = Moments.of(np.concatenate((given, *found))[..., edge:-edge], side.white[:, edge:-edge], s.rate)
    return made, [PARAMETERS] * len(given) + subsystems, [""] * len(given) + variables


def _thinned(s: Study, family: Family) -> tuple[list[Array], str, list[str]]:
    """Directions of a subsystem, thinned and whitened (K, B, m), its name, and the variable of each direction."""
    groups: dict[tuple[int, ...], list[int]] = {}
    for i, parts in enumerate(family.parts):
        rows = tuple(k for k, n in enumerate(s.names) if n in parts)
        if rows:
            groups.setdefault(rows, []).append(i)
    found, over = [], []
    for rows, members in groups.items():
        values = np.array([[thin(family.parts[i][s.names[k]], s.factor) for k in rows] for i in members])
        found.append(s.whitener(values, rows))
        over += [family.variables[i] for i in members]
    return found, family.subsystem, over


def size_of(balances: Balances, key: str) -> float:
    """What a parameter's change is counted in: its value, or the library's default where that is larger [SI]."""
    return max(abs(balances.plant.value(key)), abs(balances.model.parameter(key).default), 1e-300)


def _parameters(
    balances: Balances, channels: Mapping[str, Array], dt: float, names: tuple[str, ...], filter_: VelocityFilter,
    errors: SensorErrors, keys: Sequence[str],
) -> Array:  # fmt: skip
    """What a change of each free parameter by its size does to the balances ``(P, B, n)`` of smoothed channels."""
    formed = balances.form(channels, dt, names, filter_, errors)
    found = []
    for key in keys:
        value, size = balances.plant.value(key), size_of(balances, key)
        other = balances.with_parameters({key: value + _STEP * size}).form(channels, dt, names, filter_, errors)
        found.append((other.values - formed.values) / _STEP)
    return np.array(found).reshape(len(found), *formed.values.shape)
