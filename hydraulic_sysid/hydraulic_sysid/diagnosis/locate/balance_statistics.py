"""The statistics of balances: each beside its noise, where its error lies, and how white it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.signal import welch

from hydraulic_sim.arrays import Array
from hydraulic_sysid.diagnosis.compare import error_maps
from hydraulic_sysid.diagnosis.compare.findings import WORTH_SAYING
from hydraulic_sysid.diagnosis.compare.spectra import band_average
from hydraulic_sysid.estimation.metrics import autocorrelation, cross_correlation

from .balances import UNITS
from .record_balances import RecordBalances
from .whitening import decimate

SHOWN: dict[str, tuple[str, str, str]] = {
    "force": ("force balance", "force", UNITS["force"]),
    "flow_a": ("flow balance A", "flow", UNITS["flow_a"]),
    "flow_b": ("flow balance B", "flow", UNITS["flow_b"]),
    "valve": ("valve", "valve", "1"),
    "continuity": ("sensor continuity", "sensor", "m/s"),
    "spool": ("spool", "valve", UNITS["spool"]),
    "supply": ("supply", "supply", UNITS["supply"]),
}
"""Balances and views of the flow balances: title, subsystem and unit."""
VARIABLES = ("velocity", "opening", "load_pressure", "position", "time", "direction")
_LAGS_SECONDS = 0.25
_SEGMENT = 2.5  # s of a spectrum's segments
_STANDING = 3.0  # standard deviations of the velocity's noise below which a piston counts as standing
Pair = tuple[Array, Array]
"""A residual (m,) of one record and the same of its reference run, decimated."""


def balance_entries(studied: Sequence[RecordBalances], names: tuple[str, ...], maps: bool) -> list[dict[str, Any]]:
    """One entry per balance that could be formed, the views of the flows (valve, continuity) included."""
    rows = {
        name: [_decimated(s, *(side.formed.values[i] for side in (s.own, s.reference))) for s in studied]
        for i, name in enumerate(names)
    }
    if "flow_a" in names and "flow_b" in names:
        rows |= _views(studied, names)
    return [_entry(name, rows[name], studied, maps) for name in SHOWN if name in rows]


def _decimated(s: RecordBalances, own: Array, reference: Array) -> Pair:
    return decimate(own, s.factor), decimate(reference, s.factor)


def _views(studied: Sequence[RecordBalances], names: tuple[str, ...]) -> dict[str, list[Pair]]:
    """The two flow balances read as an opening and as a velocity.

    valve: (g_A·r_A + g_B·r_B)/(g_A² + g_B²), the opening that the measured flows ask for beyond the model's, g being
    the flow per opening; continuity: (A_A·r_A − A_B·r_B)/(A_A² + A_B²), the velocity read beyond that of the flows.
    """
    a, b = names.index("flow_a"), names.index("flow_b")
    found: dict[str, list[Pair]] = {"valve": [], "continuity": []}
    for s in studied:
        gains, plant = s.own.signals.opening_gains(), s.own.signals.plant
        areas = plant.value("piston_area_a"), -plant.value("piston_area_b")
        for view, (by_a, by_b) in (("valve", gains), ("continuity", areas)):
            both = (side.formed.values for side in (s.own, s.reference))
            found[view].append(_decimated(s, *((by_a * v[a] + by_b * v[b]) / (by_a**2 + by_b**2) for v in both)))
    return found


def _entry(name: str, pairs: Sequence[Pair], studied: Sequence[RecordBalances], maps: bool) -> dict[str, Any]:
    rate = studied[0].rate
    frequency, residual, exact = _densities(pairs, rate)
    band = _band(frequency, residual, exact)
    smooth = [tuple(_low_passed(values, band, rate) for values in pair) for pair in pairs]
    (size, exact_rms), (title, subsystem, unit) = (_rms(side) for side in zip(*smooth, strict=True)), SHOWN[name]
    entry: dict[str, Any] = {
        "name": name,
        "title": title,
        "subsystem": subsystem,
        "unit": unit,
        "band": [0.0, band],
        "residual_rms": size,
        "exact_rms": exact_rms,
        "ratio": size / exact_rms if exact_rms > 0.0 else float("inf"),
        "bias": float(np.mean(np.concatenate([own for own, _ in smooth]))),
        "records": [
            {"name": s.data.record.name, "residual_rms": _rms([own]), "exact_rms": _rms([reference])}
            for s, (own, reference) in zip(studied, smooth, strict=True)
        ],
    }
    if maps:
        entry["spectrum"] = {"frequency": frequency, "residual": np.sqrt(residual), "exact": np.sqrt(exact)}
        entry["error_maps"] = dict(_maps([own for own, _ in smooth], studied))
        entry["explained_by"] = _explained_by(entry["error_maps"])
    return entry


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _densities(pairs: Sequence[Pair], rate: float) -> tuple[Array, Array, Array]:
    """Frequencies [Hz] and power densities of residual and reference, records averaged, in logarithmic bands."""
    segment = int(min(min(own.size for own, _ in pairs), max(16, round(_SEGMENT * rate))))
    frequency: Array = np.fft.rfftfreq(segment, 1.0 / rate)[1:].astype(np.float64)
    found = []
    for side in zip(*pairs, strict=True):
        powers = [welch(values, rate, nperseg=segment, detrend=False)[1] for values in side]
        bands, amplitude = band_average(frequency, np.mean(powers, axis=0)[1:].astype(np.float64))
        found.append(amplitude**2)
    return bands, found[0], found[1]


def _band(frequency: Array, residual: Array, noise: Array) -> float:
    """Upper limit [Hz] of the band in which the signal-to-noise ratio of the residual is best.

    Residual power below it over the noise's, as a sum: where the noise rises faster than what the model lacks, more
    bandwidth only buries it. A residual that is noise alone has the lowest band.
    """
    width = np.gradient(frequency)
    excess = np.cumsum(np.maximum(residual - noise, 0.0) * width)
    spread = np.sqrt(np.cumsum(noise**2 * width) + 1e-300)
    best = int(np.argmax(excess / spread))
    return float(min(max(frequency[best], 5.0), frequency[-1]))


def _low_passed(values: Array, band: float, rate: float) -> Array:
    """A zero-phase low-pass of the band: Gaussian, −3 dB at its limit."""
    padded = np.concatenate((values, values[::-1]))
    n = padded.size
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    gain = np.exp(-0.5 * np.log(2.0) * (frequency / band) ** 2)
    return np.fft.irfft(np.fft.rfft(padded) * gain, n)[: values.size]


def _maps(residuals: Sequence[Array], studied: Sequence[RecordBalances]) -> Iterator[tuple[str, dict[str, object]]]:
    """Variable and the map of the residual over it."""
    error = np.concatenate(residuals)
    folds = error_maps.folds_of([np.arange(r.size) / s.rate for r, s in zip(residuals, studied, strict=True)])
    independent = error_maps.independent_samples(error, folds)
    for variable in VARIABLES:
        values = np.concatenate([_variable(s, variable, r.size) for s, r in zip(studied, residuals, strict=True)])
        if np.ptp(values) > 0.0:
            binning = error_maps.Binning.of(values, error_maps.DIRECTION_EDGES if variable == "direction" else None)
            yield variable, dict(vars(error_maps.error_map(error, binning, folds, independent)))


def _variable(s: RecordBalances, name: str, length: int) -> Array:
    if name == "direction":
        values = error_maps.directions(s.own.signals.velocity, _STANDING * s.data.noise["velocity"])
    else:
        values = getattr(s.own.signals, name)
    # The decimated sample stands for the middle of the smoothing kernel.
    middle = (3 * s.factor - 2) // 2 if s.factor > 1 else 0
    return values[middle :: s.factor][:length]


def _explained_by(maps: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Variables that explain the balance's error beyond chance, most first."""
    rows: list[dict[str, Any]] = [
        {"variable": name, "explained": float(m["explained"])}
        for name, m in maps.items()
        if m["explained"] > max(WORTH_SAYING, m["chance_level"])
    ]
    return sorted(rows, key=lambda row: -float(row["explained"]))


def whiteness(studied: Sequence[RecordBalances], names: tuple[str, ...]) -> dict[str, Any]:
    """Correlations of the whitened balances over all records, with bounds.

    Records are joined with their own means taken out; a whitened balance of an exact model is white of variance one, so
    that its N samples are independent and 95 % of the correlations lie within ±1.96/√N.
    """
    rate = studied[0].rate
    lags = int(round(_LAGS_SECONDS * rate))
    found: dict[str, Any] = {}
    for i, name in enumerate(names):
        own, reference = [s.own.white[i] for s in studied], [s.reference.white[i] for s in studied]
        drives = [_drive(s, p.size) for s, p in zip(studied, own, strict=True)]
        usable = [(u, p) for u, p in zip(drives, own, strict=True) if np.ptp(u) > 0.0]
        total = sum(p.size for p in own)
        bound = 1.96 / np.sqrt(total)
        correlation = _mean([autocorrelation(p, lags) for p in own], own)
        exact = _mean([autocorrelation(p, lags) for p in reference], reference)
        cross = _mean([cross_correlation(u, p, lags) for u, p in usable], [p for _, p in usable])
        outside, exact_outside = (float(np.mean(np.abs(c[1:]) > bound)) for c in (correlation, exact))
        found[name] = {
            "samples": total,
            "bound": bound,
            "lag": np.arange(lags + 1) / rate,
            "autocorrelation": correlation,
            "exact_autocorrelation": exact,
            "cross_lag": np.arange(-lags, lags + 1) / rate,
            "cross_correlation": cross,
            "outside": outside,
            "exact_outside": exact_outside,
            "cross_outside": float(np.mean(np.abs(cross) > bound)),
            "white": bool(outside <= max(0.15, 2.0 * exact_outside)),
        }
    return found


def _mean(correlations: Sequence[Array], parts: Sequence[Array]) -> Array:
    return np.average(np.array(correlations), axis=0, weights=[p.size for p in parts])


def _drive(s: RecordBalances, length: int) -> Array:
    drive = decimate(s.own.signals.drive, s.factor)
    return drive[drive.size - length :]
