"""What records show by themselves: lines in the spectrum of what a model leaves, and the position's resolution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import median_filter
from scipy.stats import gamma

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.noise import code_step
from hydraulic_sysid.estimation.segments import Segments

from .candidates import RecordFeatures
from .criteria import CRITERIA
from .linearisation import Linearisation

_AROUND = 201  # bins
_FINER = 4  # zero padding: bins between those of a record
_BESIDE = 3.0  # Hz, within which side bands of a line lie
_MOST = 2
_MOST_BINS = 1_000_000
_SLOWEST = 2.0  # Hz, slower is drift within a segment


def record_features(at: Linearisation) -> RecordFeatures:
    """Lines, the step between position readings that all records share (0 where they have none), and the stroke."""
    steps = [code_step(s.record["position"]) for s in at.split.segments]
    shared = float(np.median(steps)) if max(steps) < 1.01 * min(steps) else 0.0
    hydraulic = at.model.kind == "hydraulic"
    stroke = at.model.value("stroke") if hydraulic else math.inf
    if hydraulic and shared > 0.0:
        codes, supply = stroke / shared, at.model.value("supply_pressure")
        if any(_converted(s, codes, supply) for s in at.split.segments):
            shared = 0.0
    return RecordFeatures(spectral_lines(at.split.segments, at.residual), shared, stroke)


def _converted(segments: Segments, codes: float, supply: float) -> bool:
    """Whether the pressures, too, come in steps of about their noise: then a converter makes them, not the sensor.

    But not those of a position with far fewer ``codes`` over its stroke than they have over the ``supply`` pressure.
    """
    return any(
        (step := code_step(segments.record[channel])) > CRITERIA.steps_visible * noise
        and codes > CRITERIA.coarser * supply / step
        for channel, noise in zip(segments.channels, segments.noise_std.tolist(), strict=True)
        if channel != "position"
    )


def spectral_lines(segments: Sequence[Segments], residuals: Sequence[Array]) -> tuple[float, ...]:
    """The strongest lines [Hz] of residuals (S, m) per record, at most two. Records shorter than a second show none.

    A line shows in one record, or in all of them together where it is as unlikely by chance (powers of noise add up to
    a gamma distribution).

    What is periodic in the plant acts through a valve that reverses: of a line that leaves side bands, often higher
    than itself. They fall together again where the residual is turned over with the drive, and each record has its own;
    so the line is where the residual and the turned one, of all records, stand out most.
    """
    spectra = [found for found in map(_spectrum, segments, residuals) if found is not None]
    if not spectra:
        return ()
    finest = max(spectra, key=lambda s: len(s.frequency)).frequency
    together = np.sum([np.interp(finest, s.frequency, s.clear, right=0.0) for s in spectra], axis=0)
    single = [(s.frequency, s.clear / CRITERIA.line_stands_out) for s in spectra]
    heights = [(finest, together / _by_chance(len(spectra))), *single]
    peaks = sorted(((float(h.max()), float(frequency[np.argmax(h)])) for frequency, h in heights), reverse=True)
    distinct: list[float] = []
    for height, at in peaks:
        if height <= 1.0 or len(distinct) == _MOST:
            break
        grid = finest[(np.abs(finest - at) <= _BESIDE) & (finest > _SLOWEST)]
        score = sum(np.interp(grid, s.frequency, s.ratio) for s in spectra)
        line = float(grid[np.argmax(score)])
        if all(abs(line - other) > 0.02 * other for other in distinct):
            distinct.append(line)
    return tuple(distinct)


def _by_chance(records: int) -> float:
    """What the sum over records exceeds as seldom as one does `Criteria.line_stands_out`, each over its median."""
    return float(gamma.isf(2.0**-CRITERIA.line_stands_out, records) / math.log(2.0))


@dataclass(frozen=True)
class _Spectrum:
    """Of one record, over the median power around: the residual (``clear``), and with the turned one (``ratio``)."""

    frequency: Array
    clear: Array
    ratio: Array


def _spectrum(segments: Segments, residual: Array) -> _Spectrum | None:
    index = (segments.first[:, None] + np.arange(segments.samples - 1)).reshape(-1)
    if len(index) < 5 * _AROUND:
        return None
    # On the record's own time, zero where no segment is: a line keeps its phase over what was left out.
    begin, end = int(index.min()), int(index.max()) + 1
    run, way = np.zeros((end - begin, len(segments.channels))), np.zeros(end - begin)
    run[index - begin] = segments.by_channel(residual)[:, :-1].reshape(-1, len(segments.channels))
    sign = np.sign(segments.record["drive"][index])
    way[index - begin] = sign - sign.mean()
    way /= max(float(np.sqrt(np.mean(way**2))), 1e-9)
    finer = max(1, min(_FINER, _MOST_BINS // len(run)))  # a long record's own bins are fine enough
    count = next_fast_len(finer * len(run), real=True)
    frequency: Array = np.fft.rfftfreq(count, segments.record.dt).astype(np.float64)
    plain, turned = _power(run, np.ones_like(way), count), _power(run, way, count)
    around = np.repeat(np.asarray(median_filter(plain[::finer], _AROUND), dtype=float), finer)[: len(plain)]
    within = frequency > _SLOWEST
    floor = np.maximum(around, 1e-300)
    return _Spectrum(frequency, np.where(within, plain / floor, 0.0), np.where(within, (plain + turned) / floor, 0.0))


def _power(run: Array, factor: Array, count: int) -> Array:
    """Of all channels (N, C) times a factor (N,), windowed, zeros up to ``count``; one by one, as records are long."""
    weight = np.hanning(len(run)) * factor
    power = np.zeros(count // 2 + 1)
    for channel in run.T:
        power += np.abs(np.fft.rfft(channel * weight, count)) ** 2
    return power
