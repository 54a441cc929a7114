"""One record: its balances beside those of its reference run, and the normal equations by which they are judged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.compare.channels import Measured, Scales, measured
from hydraulic_sysid.diagnosis.compare.subject import start

from .attribution import PARAMETERS
from .balances import Balances, Residuals
from .basis import Knots
from .normal_equations import NormalEquations
from .plant_signals import Signals, signals_of, smoothed, smoothing_windows
from .regressors import Regressors, reversal_regressors, subsystem_regressors
from .sensor_errors import sensor_errors
from .spectral_lines import waves
from .whitening import Whitener, decimate, decimation_factor

_SENSED = ("position", "pressure_a", "pressure_b", "pressure_supply", "spool")
_EDGE = 0.1  # s at either end of a record, where smoothing filters have one side only
_STEP = 1e-3  # difference step of a parameter, of its size


@dataclass(frozen=True)
class Side:
    """Balances of a record or of its reference run: ``(B, n)``, decimated and whitened ``(B, m)``, and signals."""

    formed: Residuals
    white: Array
    signals: Signals


@dataclass(frozen=True)
class RecordBalances:
    """A record and its reference run: the record that an exact model would have made under the same noise.

    ``parameters`` (P, B, m): what the model's parameters do to its balances, whitened, per change by their size.
    """

    data: Measured
    names: tuple[str, ...]
    own: Side
    reference: Side
    whitener: Whitener
    factor: int
    parameters: Array

    @property
    def rate(self) -> float:
        """Decimated samples per second."""
        return 1.0 / (self.factor * self.data.record.dt)


def record_balances(
    balances: Balances, record: Record, names: tuple[str, ...], keys: Sequence[str], seed: int
) -> RecordBalances:
    """Form ``names`` of a record; ``keys`` are the parameters that may move. ``seed`` draws the reference's noise."""
    balances = balances.with_parameters(record.settings)
    plant, drive, dt = balances.plant, record["drive"], record.dt
    data, factor = measured(record, Scales.of(balances.model)), decimation_factor(record.dt)
    filter_ = data.velocity_filter
    free = plant.simulate(drive, dt, start(plant, data))
    errors = sensor_errors(balances.model, plant, free)
    own = {n: v for n, v in data.channels.items() if n in _SENSED or n == "drive"}
    rng = np.random.default_rng(seed)
    clean = {**own, **{n: free[n] for n in own if n != "drive"}}
    # Noise drawn a second time makes the whitener: the reference's own would look whiter to it than the record's can.
    noisy, other = (
        {n: v if n == "drive" else v + data.noise[n] * rng.standard_normal(v.size) for n, v in clean.items()}
        for _ in range(2)
    )
    form = partial(Balances.form, dt=dt, names=names, to_velocity=filter_, errors=errors)
    formed, bare, reference, again = (form(balances, c) for c in (own, clean, noisy, other))
    whitener = Whitener.of(decimate(again.values - bare.values, factor))
    windows = smoothing_windows(own, data.noise, dt)
    still = {**own, **smoothed({n: v for n, v in own.items() if n in _SENSED}, windows)}
    unmoved = form(balances, still).values
    changes = np.zeros((len(keys), *unmoved.shape))
    for i, key in enumerate(keys):
        moved = balances.with_parameters({key: plant.value(key) + _STEP * size_of(balances, key)})
        changes[i] = (form(moved, still).values - unmoved) / _STEP

    def side(channels: Mapping[str, Array], residuals: Residuals) -> Side:
        read, noise = errors.corrected(channels), data.noise["velocity"]
        signals = signals_of(plant, read, drive, dt, residuals, filter_, noise, windows)
        return Side(residuals, whitener(decimate(residuals.values, factor)), signals)

    parameters = whitener(decimate(changes, factor))
    return RecordBalances(data, names, side(own, formed), side(noisy, reference), whitener, factor, parameters)


def normal_equations(
    s: RecordBalances, side: Side, knots: Knots, lines: Sequence[float], record: int, records: int
) -> tuple[NormalEquations, list[str], list[str]]:
    """Those of one side, and the subsystem and the variable of every regressor.

    ``lines``: frequencies [Hz] that most records show; ``s`` is the ``record``-th of ``records``.
    """
    subsystems, variables, found = [], [], []
    every = subsystem_regressors(side.signals, s.names, knots, waves(lines, side.signals.time, record, records))
    for parts, subsystem, own in map(lambda regressors: _whitened(s, regressors), every):  # which keeps none alive
        found += parts
        subsystems += [subsystem] * len(own)
        variables += own
    reversals = np.zeros((0, *s.parameters.shape[1:]))
    if "force" in s.names:
        forces = reversal_regressors(side.signals, s.data.noise["position"])[:, None]
        reversals = s.whitener(decimate(forces, s.factor), (0,))
    given = np.concatenate((s.parameters, reversals))
    edge = max(1, int(round(_EDGE * s.rate)))
    regressors = np.concatenate((given, *found))[..., edge:-edge]
    made = NormalEquations.of(regressors, side.white[:, edge:-edge], s.rate)
    return made, [PARAMETERS] * len(given) + subsystems, [""] * len(given) + variables


def _whitened(s: RecordBalances, regressors: Regressors) -> tuple[list[Array], str, list[str]]:
    """A subsystem's regressors, decimated and whitened (K, B, m), its name, and the variable of each."""
    groups: dict[tuple[int, ...], list[int]] = {}
    for i, parts in enumerate(regressors.parts):
        rows = tuple(k for k, n in enumerate(s.names) if n in parts)
        if rows:
            groups.setdefault(rows, []).append(i)
    found, variables = [], []
    for rows, members in groups.items():
        values = np.array([[decimate(regressors.parts[i][s.names[k]], s.factor) for k in rows] for i in members])
        found.append(s.whitener(values, rows))
        variables += [regressors.variables[i] for i in members]
    return found, regressors.subsystem, variables


def size_of(balances: Balances, key: str) -> float:
    """What a parameter's change is counted in: its value, or the library's default where that is larger [SI]."""
    return max(abs(balances.plant.value(key)), abs(balances.model.parameter(key).default), 1e-300)
