"""What a fit teaches of the recording: noise with its colour, hum, outliers, channels that are late.

A first fit takes the noise for white. What it leaves shows what the noise is; judged by that, the next fit leaves less
of the model's own errors. Two rounds are enough: the noise hardly changes with the model once it is near.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from hydraulic_sim.arrays import Array, Mask

from . import noise_model
from .covariance import inverse
from .fit import FitPoint
from .noise_model import ChannelNoise
from .parameters import Parameters
from .segments import Segments

LATE = 0.35  # sampling intervals by which a channel may be late without being named
LAW = 0.03  # share of itself by which every law may be off in a segment: no law is quite that of a bench
TIMING = 0.3  # sampling intervals by which a channel may be late without further reason (order of conversion, filters)
NEAR = 2.0  # residual over noise up to which a model says what delays there are
HUM = 10.0  # standard deviations of the noise that a mains line may have in a segment
OUTLYING = 10.0  # times the cost of nine in ten segments: a segment that says nothing of the noise, …
ACCIDENTS = 0.02  # … and is left out, if no more are than this share of all, or one


def refined(point: FitPoint, columns: Sequence[Array], laws: Collection[str]) -> list[Segments]:
    """The point's segments as what it leaves (residuals and parameter ``columns[i]`` (S, m, P)) shows them to be.

    Noise, outliers, hum and delays are those of a channel in all records.

    :param laws: parameters that stand for a law each, which may be off by `LAW` of itself in a segment
    """
    segments, projections = point.shooting.segments, point.projections
    channels = list(dict.fromkeys(c for s in segments for c in s.channels))
    left = [s.in_units(p.residual) for s, p in zip(segments, projections, strict=True)]
    told = point.cost < NEAR**2 * sum(int(s.counted.sum()) for s in segments)
    late = _delays(point, columns, channels) if told else {}
    noise: dict[str, ChannelNoise] = {}
    loud = [np.ones_like(s.loudness) for s in segments]
    spikes = _spikes(point, left, channels, noise_model.SPIKY if told else noise_model.VERY_SPIKY)
    near = _near(point, spikes)
    lines: dict[str, tuple[float, ...]] = {}
    for channel in channels:
        where = [(i, s.channels.index(channel)) for i, s in enumerate(segments) if channel in s.channels]
        dt = segments[where[0][0]].record.dt
        cleaned = [np.where(spikes[i][:, :, c], 0.0, left[i][:, :, c])[near[i]] for i, c in where]
        known = {f for i, c in where for f in segments[i].hum[c]}
        parts = [segments[i].subset(near[i]) for i, _ in where]
        lines[channel] = tuple(known) or _lines(list(map(_in_place, cleaned, parts)), dt)
        quiet = [_without(r, lines[channel], part) for r, part in zip(cleaned, parts, strict=True)]
        # Its colour is that of all, each segment brought to the same strength.
        even = noise_model.estimate(quiet, dt)
        strength = noise_model.loudness(quiet, even)
        for (i, c), own in zip(where, strength, strict=True):
            loud[i][near[i], c] = own
        noise[channel] = noise_model.estimate([q / own[:, None] for q, own in zip(quiet, strength, strict=True)], dt)
    found, shares = [], _shares(point.parameters, laws)
    for i, s in enumerate(segments):
        readings = tuple(replace(t, delay=late.get(c, t.delay)) for c, t in zip(s.channels, s.readings, strict=True))
        judged = replace(
            s, loudness=loud[i], outliers=spikes[i], readings=readings, hum=tuple(lines[c] for c in s.channels)
        )
        judged = judged.with_noise([noise[c] for c in s.channels])
        found.append(_with_nuisance(judged, _raw_columns(s, columns[i], shares)))
    return found


def without_outliers(point: FitPoint, columns: Sequence[Array], laws: Collection[str]) -> list[Segments]:
    """The point's segments without their outliers, every law off a little, as in `refined`; the rest is known."""
    segments, shares = point.shooting.segments, _shares(point.parameters, laws)
    channels = list(dict.fromkeys(c for s in segments for c in s.channels))
    left = [s.in_units(p.residual) for s, p in zip(segments, point.projections, strict=True)]
    spikes = _spikes(point, left, channels, noise_model.SPIKY)
    every = zip(segments, spikes, columns, strict=True)
    return [_with_nuisance(replace(s, outliers=out), _raw_columns(s, own, shares)) for s, out, own in every]


def with_hum(segments: Segments) -> Segments:
    """Segments in which nothing but the mains lines that are known of them may be."""
    return _with_nuisance(segments, np.zeros((*segments.measured.shape, 0)))


def _with_nuisance(segments: Segments, off: Array) -> Segments:
    """Segments in which laws may be ``off`` (S, samples, C, K) [SI] besides what the recording adds."""
    hum = _hum(segments, segments.hum, [n.std for n in segments.noise])
    raw = np.concatenate((off, hum, segments.disturbance), axis=-1)  # in this order: `Segments.with_exact_laws`
    return replace(segments, nuisance=segments.whitened(raw))


def _shares(parameters: Parameters, laws: Collection[str]) -> Array:
    """(P,) by how many of its scales each of the ``laws`` may be off in a segment, 0 for all other parameters."""
    own = np.array([k in laws for k in parameters.keys], dtype=bool)
    return np.where(own, parameters.values / parameters.scales * LAW, 0.0)


def ordinary(point: FitPoint, found: Sequence[Segments]) -> list[Mask]:
    """Which segments are not far off all others: (S,) per record; ``found`` are the point's with their outliers."""
    return _near(point, [s.outliers for s in found])


def but_accidents(near: Sequence[Mask], before: int = 0) -> list[Mask]:
    """All segments (S,) but the few that are not ``near``, as after a knock on the bench.

    Where many are not, something acts there that the model does not have; so it does where all of a record are not.

    :param before: how many were left out before
    """
    every = np.concatenate(near)
    out = np.count_nonzero(~every) + before
    accident = out <= max(1.0, ACCIDENTS * (every.size + before))
    return [n if accident and n.any() else np.ones_like(n) for n in near]


def _near(point: FitPoint, spikes: Sequence[Mask]) -> list[Mask]:
    """Which segments (S,) are not far off all others, whatever the samples that are spikes (S, samples, C) say."""
    segments = point.shooting.segments
    left = [
        np.where(out, 0.0, s.by_channel(p.residual))
        for s, p, out in zip(segments, point.projections, spikes, strict=True)
    ]
    squares = [np.mean(one**2, axis=(1, 2)) for one in left]
    return [~outlying(own, np.concatenate(squares)) for own in squares]


def outlying(squares: Array, every: Array) -> Mask:
    """Which segments' mean squares (S,) are far off those of all others (N,)."""
    return np.asarray(squares > OUTLYING * float(np.quantile(every, 0.9)))


def _spikes(point: FitPoint, left: Sequence[Array], channels: Sequence[str], known: float) -> list[Mask]:
    """Samples (S, samples, C) that are outliers of what a point has ``left`` (S, samples, C) [SI].

    ``known``: share of a channel's samples from which it is known to have spikes.
    """
    segments = point.shooting.segments
    runs = point.shooting.simulated(point.plant, point.initial_states)
    deviations = [np.abs(s.measured - s.recorded(run)) for s, run in zip(segments, runs, strict=True)]
    found = [s.outliers.copy() for s in segments]
    for channel in channels:
        where = [(i, s.channels.index(channel)) for i, s in enumerate(segments) if channel in s.channels]
        first = noise_model.estimate([left[i][:, :, c] for i, c in where], segments[where[0][0]].record.dt)
        spiky = np.mean(np.concatenate([found[i][:, :, c].ravel() for i, c in where])) > known
        for i, c in where:
            found[i][:, :, c] &= deviations[i][:, :, c] > noise_model.OUTLIER * first.std
            found[i][:, :, c] |= noise_model.outliers(left[i][:, :, c], first)
            if spiky:
                found[i][:, :, c] |= noise_model.jumps(left[i][:, :, c], first, segments[i].measured[:, :, c])
    return found


def _raw_columns(segments: Segments, columns: Array, shares: Array) -> Array:
    """Whitened columns (S, m, P), each times its share, as deviations (S, samples, C, P) [SI]."""
    if not np.any(shares):
        return np.zeros((*segments.measured.shape, 0))
    return np.stack([segments.in_units(columns[..., k] * share) for k, share in enumerate(shares) if share], axis=-1)


def _rates(segments: Segments, raw: Array) -> Array:
    """Change (S, samples, C, C) of what is recorded with the delay of each channel [1/s]."""
    recorded = segments.measured - segments.in_units(raw)
    rate = np.gradient(recorded, segments.record.dt, axis=1)
    return rate[..., None] * np.eye(len(segments.channels))


def _hum(segments: Segments, lines: Sequence[Sequence[float]], size: Sequence[float]) -> Array:
    """Sine and cosine (S, samples, C, K) of every line of a channel, as large as hum may be."""
    found = []
    for c, (frequencies, std) in enumerate(zip(lines, size, strict=True)):
        column = np.zeros((*segments.measured.shape, 2 * len(frequencies)))
        column[:, :, c] = HUM * std * _waves(segments, frequencies)
        found.append(column)
    return np.concatenate(found, axis=-1)


def _waves(segments: Segments, lines: Sequence[float]) -> Array:
    """Sine and cosine (S, samples, 2·L) of every line, on the record's time."""
    time = (segments.first[:, None] + np.arange(segments.samples)) * segments.record.dt
    angle = 2.0 * np.pi * time[..., None] * np.array(lines)
    return np.concatenate((np.sin(angle), np.cos(angle)), axis=-1)


def _without(residual: Array, lines: Sequence[float], segments: Segments) -> Array:
    """Residuals (S, samples) of one channel without their lines, segment by segment."""
    if not lines:
        return residual
    basis, _ = np.linalg.qr(_waves(segments, lines))
    return residual - (basis @ (np.swapaxes(basis, -1, -2) @ residual[..., None]))[..., 0]


def _in_place(residual: Array, segments: Segments) -> Array:
    """Residuals (S, samples) on the record's time, 0 where no segment is: a line keeps its phase over what is out."""
    if not len(segments):
        return np.zeros(segments.samples)
    index = segments.first[:, None] + np.arange(segments.samples)
    found = np.zeros(int(np.ptp(index)) + 1)
    found[index - index.min()] = residual - residual.mean()
    return found


def _lines(residuals: Sequence[Array], dt: float) -> tuple[float, ...]:
    """Lines that stand out in at least half of the records."""
    found = [noise_model.mains_lines(r, dt) for r in residuals]
    every = sorted({f for lines in found for f in lines})
    return tuple(f for f in every if 2 * sum(f in lines for lines in found) >= len(found))


def _delays(point: FitPoint, columns: Sequence[Array], channels: Sequence[str]) -> dict[str, float]:
    """How late every channel was recorded [s]: one Gauss-Newton step beside the parameters, from what they are."""
    segments = point.shooting.segments
    count, new = len(point.parameters), len(channels)
    information, gradient = np.zeros((count + new,) * 2), np.zeros(count + new)
    for s, p, own in zip(segments, point.projections, columns, strict=True):
        rate = s.whitened(_rates(s, p.raw))
        placed = np.zeros((*p.raw.shape, new))
        for c, channel in enumerate(s.channels):
            placed[:, : rate.shape[1], channels.index(channel)] = rate[..., c] * s.record.dt
        every = p.beyond(np.concatenate((own, placed), axis=-1))
        information += np.tensordot(every, every, axes=([0, 1], [0, 1]))
        gradient += np.tensordot(every, p.residual, axes=([0, 1], [0, 1]))
    now = {c: t.delay / s.record.dt for s in segments for c, t in zip(s.channels, s.readings, strict=True)}
    named = {c: t.named / s.record.dt for s in segments for c, t in zip(s.channels, s.readings, strict=True)}
    dt = {c: s.record.dt for s in segments for c in s.channels}
    late = np.arange(count, count + new)
    off = np.array([now[c] - named[c] for c in channels])
    information += np.diag(np.concatenate((point.parameters.prior_information, np.full(new, TIMING**-2))))
    gradient += np.concatenate((point.parameters.prior_gradient, off * TIMING**-2))
    known = np.diag(information)
    scale = np.sqrt(np.where(known > 0.0, known, 1.0))
    cover = inverse(information / np.outer(scale, scale)) / np.outer(scale, scale)
    step = np.clip(off - (cover @ gradient)[late], -LATE, LATE)
    return {c: (named[c] + float(step[k])) * dt[c] for k, c in enumerate(channels)}
