"""The figures of a location: each balance beside its noise, where its error sits, and how white it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.signal import welch

from hydraulic_sim.arrays import Array
from hydraulic_sysid.diagnosis.compare import errormaps
from hydraulic_sysid.diagnosis.compare.findings import WORTH_SAYING
from hydraulic_sysid.diagnosis.compare.spectra import band_average
from hydraulic_sysid.estimation.metrics import autocorrelation, cross_correlation

from .balances import UNITS
from .blame import Verdict
from .noise_model import thin
from .study import Study

TITLES = {
    "force": "force balance",
    "flow_a": "flow balance A",
    "flow_b": "flow balance B",
    "valve": "valve",
    "continuity": "sensor continuity",
    "spool": "spool",
    "supply": "supply",
}
SUBSYSTEM = {
    "force": "force", "flow_a": "flow", "flow_b": "flow", "valve": "valve", "continuity": "sensor", "spool": "valve",
    "supply": "supply",
}  # fmt: skip
VARIABLES = {
    "velocity": "m/s", "opening": "1", "load_pressure": "Pa", "position": "m", "time": "s", "direction": "1",
}  # fmt: skip
_LAGS_SECONDS = 0.25
_SEGMENT = 2.5  # s of a spectrum's segments
_STANDING = 3.0
_TIED = 0.01  # of what is missing: subsystems that explain as much as the best but for this cannot be told apart


def balances(studies: Sequence[Study], names: tuple[str, ...], maps: bool) -> list[dict[str, Any]]:
    """One entry per balance that could be formed, the views of the flows (valve, continuity) included."""
    rows = {
        name: [_Series(s.factor, *(v[i] for v in (s.own.formed.values, s.twin.formed.values))) for s in studies]
        for i, name in enumerate(names)
    }
    if "flow_a" in names and "flow_b" in names:
        rows |= _views(studies, names)
    entries = []
    for name in TITLES:
        if name in rows:
            entries.append(_entry(name, rows[name], studies, maps))
    return entries


class _Series:
    """One balance of one record, thinned: measured and of the twin, (m,) each."""

    def __init__(self, factor: int, measured: Array, twin: Array) -> None:
        self.measured, self.twin = thin(measured, factor), thin(twin, factor)

    def low_passed(self, band: float, rate: float) -> _Series:
        """Both below a frequency [Hz]."""
        return _Series(1, _low_passed(self.measured, band, rate), _low_passed(self.twin, band, rate))


def _views(studies: Sequence[Study], names: tuple[str, ...]) -> dict[str, list[_Series]]:
    """The two flow balances read as an opening and as a velocity.

    valve: (g_A·r_A + g_B·r_B)/(g_A² + g_B²), the opening that the measured flows ask for beyond the model's, g being
    the flow per opening; continuity: (A_A·r_A − A_B·r_B)/(A_A² + A_B²), the velocity read beyond that of the flows.
    """
    a, b = names.index("flow_a"), names.index("flow_b")
    found: dict[str, list[_Series]] = {"valve": [], "continuity": []}
    for s in studies:
        gain_a, gain_b = s.own.signals.opening_gains()
        plant = s.own.signals.plant
        area_a, area_b = plant.value("piston_area_a"), -plant.value("piston_area_b")
        for view, by_a, by_b in (("valve", gain_a, gain_b), ("continuity", area_a, area_b)):
            size = by_a**2 + by_b**2
            both = (s.own.formed.values, s.twin.formed.values)
            found[view].append(_Series(s.factor, *((by_a * v[a] + by_b * v[b]) / size for v in both)))
    return found


def _entry(name: str, series: Sequence[_Series], studies: Sequence[Study], maps: bool) -> dict[str, Any]:
    rate = studies[0].rate
    frequency, residual, noise = _densities(series, rate)
    band = _band(frequency, residual, noise)
    smooth = [s.low_passed(band, rate) for s in series]
    size, floor = (_rms([getattr(s, k) for s in smooth]) for k in ("measured", "twin"))
    entry: dict[str, Any] = {
        "name": name,
        "title": TITLES[name],
        "subsystem": SUBSYSTEM[name],
        "unit": UNITS.get(name, {"valve": "1", "continuity": "m/s"}.get(name, "1")),
        "band": [0.0, band],
        "residual_rms": size,
        "exact_rms": floor,
        "ratio": size / floor if floor > 0.0 else float("inf"),
        "bias": float(np.mean(np.concatenate([s.measured for s in smooth]))),
        "records": [
            {"name": s.data.record.name, "residual_rms": _rms([x.measured]), "exact_rms": _rms([x.twin])}
            for s, x in zip(studies, smooth, strict=True)
        ],
    }
    if maps:
        entry["spectrum"] = {"frequency": frequency, "residual": np.sqrt(residual), "exact": np.sqrt(noise)}
        entry["error_maps"] = _maps([x.measured for x in smooth], studies)
        entry["explained_by"] = _over(entry["error_maps"])
    return entry


def _rms(parts: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _densities(series: Sequence[_Series], rate: float) -> tuple[Array, Array, Array]:
    """Frequencies [Hz] and power densities of residual and noise, records averaged, in bands of a logarithmic axis."""
    segment = int(min(min(s.measured.size for s in series), max(16, round(_SEGMENT * rate))))
    powers = []
    for key in ("measured", "twin"):
        found = [welch(getattr(s, key), rate, nperseg=segment, detrend=False) for s in series]
        powers.append(np.mean([p for _, p in found], axis=0)[1:].astype(np.float64))
    frequency: Array = np.fft.rfftfreq(segment, 1.0 / rate)[1:].astype(np.float64)
    bands, residual = band_average(frequency, powers[0])
    _, noise = band_average(frequency, powers[1])
    return bands, residual**2, noise**2


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


def _maps(residuals: Sequence[Array], studies: Sequence[Study]) -> dict[str, dict[str, object]]:
    error = np.concatenate(residuals)
    folds = errormaps.folds_of([np.arange(r.size) / s.rate for r, s in zip(residuals, studies, strict=True)])
    independent = errormaps.independent_samples(error, folds)
    found = {}
    for variable in VARIABLES:
        parts = [_variable(s, variable, r.size) for s, r in zip(studies, residuals, strict=True)]
        values = np.concatenate(parts)
        edges = np.array([-1.5, -0.5, 0.5, 1.5]) if variable == "direction" else None
        if not np.ptp(values) > 0.0:
            continue
        binning = errormaps.Binning.of(values, edges)
        found[variable] = errormaps.error_map(error, binning, folds, independent).as_dict()
    return found


def _variable(s: Study, name: str, length: int) -> Array:
    if name == "direction":
        moving = s.own.signals.velocity
        threshold = _STANDING * s.data.noise["velocity"]
        values = np.where(moving > threshold, 1.0, np.where(moving < -threshold, -1.0, 0.0))
    else:
        values = {
            "velocity": s.own.signals.velocity,
            "opening": s.own.signals.opening,
            "load_pressure": s.own.signals.load_pressure,
            "position": s.own.signals.position,
            "time": s.own.signals.time,
        }[name]
    # The thinned sample stands for the middle of the smoothing kernel.
    middle = (3 * s.factor - 2) // 2 if s.factor > 1 else 0
    return values[middle :: s.factor][:length]


def _over(maps: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Variables that explain the balance's error beyond chance, most first."""
    told: list[dict[str, Any]] = [
        {"variable": name, "explained": float(m["explained"])}
        for name, m in maps.items()
        if m["explained"] > max(WORTH_SAYING, m["chance_level"])
    ]
    return sorted(told, key=lambda row: -float(row["explained"]))


def misfit(verdict: Verdict | None) -> dict[str, Any] | None:
    """Mean square over noise of all whitened balances: of the model, its parameters moved, and all blame taken."""
    if verdict is None:
        return None
    return {
        "model": verdict.before,
        "refitted": verdict.refitted,
        "attributed": verdict.left,
        "exact_model": verdict.exact,
        "samples": int(verdict.count),
    }


def subsystems(verdict: Verdict | None) -> list[dict[str, Any]]:
    """Ranked subsystems as plain dictionaries."""
    if verdict is None:
        return []
    best = max(b.alone for b in verdict.ranked)
    return [
        {
            "name": b.subsystem,
            "share": b.share,
            "alone": b.alone,
            "reduction": b.gain,
            "variables": b.variables,
            "indistinguishable": b.alone >= best - _TIED,
        }
        for b in verdict.ranked
    ]


def whiteness(studies: Sequence[Study], names: tuple[str, ...]) -> dict[str, Any]:
    """Correlations of the whitened balances over all records, with bounds.

    Records are joined with their own means taken out; a whitened balance of an exact model is white of variance one, so
    that its N samples are independent and 95 % of the correlations lie within ±1.96/√N.
    """
    rate = studies[0].rate
    lags = int(round(_LAGS_SECONDS * rate))
    found: dict[str, Any] = {}
    for i, name in enumerate(names):
        total = sum(s.own.white.shape[1] for s in studies)
        bound = 1.96 / np.sqrt(total)
        entry: dict[str, Any] = {"samples": total, "bound": bound, "lag": np.arange(lags + 1) / rate}
        for key, rows in (("autocorrelation", "own"), ("exact_autocorrelation", "twin")):
            parts = [getattr(s, rows).white[i] for s in studies]
            entry[key] = _mean([autocorrelation(p, lags) for p in parts], parts)
        parts = [s.own.white[i] for s in studies]
        drives = [_drive(s, p.size) for s, p in zip(studies, parts, strict=True)]
        usable = [(u, p) for u, p in zip(drives, parts, strict=True) if np.ptp(u) > 0.0]
        entry["cross_lag"] = np.arange(-lags, lags + 1) / rate
        entry["cross_correlation"] = _mean([cross_correlation(u, p, lags) for u, p in usable], [p for _, p in usable])
        entry["outside"] = float(np.mean(np.abs(entry["autocorrelation"][1:]) > bound))
        entry["exact_outside"] = float(np.mean(np.abs(entry["exact_autocorrelation"][1:]) > bound))
        entry["cross_outside"] = float(np.mean(np.abs(entry["cross_correlation"]) > bound))
        entry["white"] = bool(entry["outside"] <= max(0.15, 2.0 * entry["exact_outside"]))
        found[name] = entry
    return found


def _mean(correlations: Sequence[Array], parts: Sequence[Array]) -> Array:
    weights = [p.size for p in parts]
    return np.average(np.array(correlations), axis=0, weights=weights)


def _drive(s: Study, length: int) -> Array:
    drive = thin(s.own.signals.drive, s.factor)
    return drive[drive.size - length :]
