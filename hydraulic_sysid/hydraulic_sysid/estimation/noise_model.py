"""Noise models of measured channels, and whitening with them.

A channel's noise is autoregressive, e_t + a_1·e_{t−1} + … + a_p·e_{t−p} = w_t with white innovations w of standard
deviation σ (Yule–Walker equations; Ljung, System Identification, ch. 4): filters, converters and what a transducer adds
give it colour. Beside it stand spectral lines (mains) and outliers. The model is estimated from what a fitted plant
leaves, on segments that are no worse than the quietest ones: noise is the same at rest and in motion, errors of a model
are not.

"1 × the noise" then is what an exact model leaves, whatever the sensors are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import hankel, solve_toeplitz, solve_triangular, toeplitz
from scipy.ndimage import median_filter
from scipy.signal import lfilter, welch
from scipy.stats import gamma

from hydraulic_sim.arrays import Array, Mask

from .whitened_residual import whitened

ORDER = 12  # of the autoregression: two second-order filters and what hum and rounding add
WINDOW = 128  # samples of a periodogram
BAND = 60.0  # Hz, above which a residual is the sensor's own rather than an error of the model, …
BAND_SHARE = 0.3  # … or this share of the Nyquist frequency where the sampling is slow
CAP = 1.5  # of the largest power above: what noise may have below
LOADING = 1e-5  # of the variance, added as a white part: no noise is without one, and no model exact below it
QUIET = 0.2  # quantile of the segments' mean squares from which the noise is judged
WITHIN = 3.5  # standard deviations of a mean square above which a segment holds more than noise
OUTLIER = 6.0  # innovations' standard deviations
AROUND = (1, 9)  # segments and samples that are beside one
JUMP = 0.5  # of what a spike is off the residuals beside it, by which it is off the readings beside it
SPIKY = 1e-4  # share of the samples of a channel that stand alone: more are a fault of the recording, …
VERY_SPIKY = 1e-3  # … and of so many more are looked for however far off the model is
MAINS = (50.0, 60.0)  # Hz
HARMONICS = (1, 2, 3, 5)
UNSTEADY = 0.25  # spread of the logarithm of the power between segments, beyond chance, from which noise is not steady
LOUDEST = 2.0  # of that logarithm, to either side
QUARTILES = 1.349  # standard deviations between those of a normal distribution
FEWEST = 20  # segments that show a spread
STANDS_OUT = 25.0  # power of a line over the median power around it


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one channel: ``coefficients`` (p + 1,) with a_0 = 1, ``innovation`` σ, ``autocovariance`` (p + 1,)."""

    coefficients: Array
    innovation: float
    autocovariance: Array

    @classmethod
    def white(cls, std: float) -> ChannelNoise:
        """White noise of a standard deviation."""
        return cls(np.ones(1), std, np.array([std**2]))

    @property
    def std(self) -> float:
        """Standard deviation, colour included."""
        return float(np.sqrt(self.autocovariance[0]))

    @property
    def order(self) -> int:
        """p, of the autoregression."""
        return len(self.coefficients) - 1

    @cached_property
    def filter(self) -> Array:
        """(p + 1,) what makes innovations of unit variance of noise."""
        return self.coefficients / self.innovation

    @cached_property
    def head(self) -> Array:
        """(p, p) the same of its first p samples: the inverse of the Cholesky factor of their covariance."""
        if not self.order:
            return np.zeros((0, 0))
        return np.ascontiguousarray(solve_triangular(self._root, np.eye(self.order), lower=True))

    @cached_property
    def _root(self) -> Array:
        """Cholesky factor of the covariance of the first p samples."""
        return np.linalg.cholesky(toeplitz(self.autocovariance[: self.order]))

    def whiten(self, values: Array) -> Array:
        """(S, n, …) along the second axis, n > p: unit variance and no colour where ``values`` are this noise."""
        width = int(np.prod(values.shape[2:]))
        rows = np.ascontiguousarray(values, dtype=float).reshape(len(values), values.shape[1] * width)
        return np.asarray(whitened(rows, width, self.filter, self.head)).reshape(values.shape)

    def missing(self, outliers: Mask) -> list[tuple[int, Array]]:
        """What samples that do not count (S, n) could change: rows, and orthonormal whitened columns (n, G) of each."""
        found = []
        for row in np.flatnonzero(outliers.any(axis=1)).tolist():
            samples = np.flatnonzero(outliers[row])
            impulses = np.zeros((1, outliers.shape[1], samples.size))
            impulses[0, samples, np.arange(samples.size)] = self.innovation
            basis, _ = np.linalg.qr(self.whiten(impulses)[0])
            found.append((row, basis))
        return found

    def colour(self, white: Array) -> Array:
        """The inverse of `whiten` for (S, n)."""
        if not self.order:
            return white * self.innovation
        values = np.empty_like(white)
        p = self.order
        values[:, :p] = white[:, :p] @ self._root.T
        begin = -values[:, p - 1 :: -1][:, :p] @ hankel(self.coefficients[1:])  # what the filter remembers
        values[:, p:], _ = lfilter([self.innovation], self.coefficients, white[:, p:], axis=1, zi=begin)
        return values


def estimate(residuals: Sequence[Array], dt: float, order: int = ORDER) -> ChannelNoise:
    """The noise in residuals (S_i, n_i) of one channel, one array per record, sampled every ``dt`` seconds.

    A model's errors are slow and would pass for coloured noise. A sensor's noise is no stronger at low frequencies than
    in the band above the plant's: what is, is capped.
    """
    squares = np.concatenate([np.mean(r**2, axis=1) for r in residuals])
    length = float(np.mean([r.shape[1] for r in residuals]))
    quiet = float(np.quantile(squares, QUIET))
    kept = squares <= 4.0 * quiet
    for _ in range(10):
        covariance = _capped(_spectrum(residuals, kept), dt, order)
        correlation = covariance / covariance[0]
        scatter = float((2.0 * (1.0 + 2.0 * float(np.sum(correlation[1:] ** 2))) / length) ** 0.5)
        # A segment's mean square is about a gamma variable; its quantile gives the mean, and that the limit.
        mean = quiet / gamma.ppf(QUIET, scatter**-2, scale=scatter**2)
        again = squares <= mean * (1.0 + WITHIN * scatter)
        if np.array_equal(again, kept):
            break
        kept = again
    coefficients = np.concatenate(([1.0], -solve_toeplitz(covariance[:-1], covariance[1:]))) if order else np.ones(1)
    innovation = max(float(coefficients @ covariance), np.finfo(float).tiny) ** 0.5
    return ChannelNoise(coefficients, innovation, covariance)


def loudness(residuals: Sequence[Array], noise: ChannelNoise) -> list[Array]:
    """By how many times the noise is stronger in each segment (S_i,) than `noise` says, of residuals (S_i, n_i).

    Noise of valves, pumps and amplifiers depends on what they do. It is judged in the upper half of the band, where a
    plant is quiet and a model's error is small. What is chance or the matter of a few segments does not count: then all
    are as loud.
    """
    power, worth = [], []
    for r in residuals:
        spectrum = np.abs(np.fft.rfft(noise.whiten(r), axis=1)) ** 2 / r.shape[1]
        upper = spectrum[:, spectrum.shape[1] // 2 :]
        power.append(upper.mean(axis=1))
        worth.append(np.full(len(r), 1.0 / upper.shape[1]))
    every, chance = np.concatenate(power), np.concatenate(worth)
    level = np.log(np.maximum(every, 1e-12))
    low, middle, high = np.quantile(level, [0.25, 0.5, 0.75]).tolist()
    spread = ((high - low) / QUARTILES) ** 2 - float(chance.mean())
    if every.size < FEWEST or spread < UNSTEADY**2:
        return [np.ones(len(r)) for r in residuals]
    shrunk = [
        middle + (np.log(np.maximum(p, 1e-12)) - middle) * spread / (spread + w)
        for p, w in zip(power, worth, strict=True)
    ]
    return [np.exp(0.5 * np.clip(at, -LOUDEST, LOUDEST)) for at in shrunk]


def _spectrum(residuals: Sequence[Array], kept: Mask) -> Array:
    """Two-sided power spectrum (F,) of the kept segments: its mean is their variance (Welch 1967)."""
    total, count, begin = np.zeros(WINDOW // 2 + 1), 0, 0
    for r in residuals:
        chosen = r[kept[begin : begin + len(r)]]
        begin += len(r)
        length = min(WINDOW, r.shape[1])
        if len(chosen):
            _, power = welch(chosen, 1.0, "hann", length, nfft=WINDOW, detrend=False, scaling="density", axis=1)
            total += power.sum(axis=0)
            count += len(chosen)
    one_sided = total / max(count, 1)
    one_sided[1:-1] *= 0.5
    return one_sided


def _capped(spectrum: Array, dt: float, order: int) -> Array:
    """Autocovariance (order + 1,) of a spectrum that is no higher below the band of sensors than within it."""
    frequency = np.arange(spectrum.size) / (WINDOW * dt)
    above = frequency >= min(BAND, BAND_SHARE * 0.5 / dt)
    cap = CAP * float(spectrum[above].max())
    found = np.fft.irfft(np.where(above, spectrum, np.minimum(spectrum, cap)))[: order + 1]
    found[0] *= 1.0 + LOADING
    return found


def outliers(residuals: Array, noise: ChannelNoise) -> Mask:
    """(S, n) which samples stand alone, far off the noise: spikes of a converter or a cable, not a model's error.

    A model's error lasts; a spike does not, so that it stands out from the residuals beside it as well.
    """
    return _stands_out(np.abs(residuals), noise)


def jumps(residuals: Array, noise: ChannelNoise, readings: Array) -> Mask:
    """(S, n) which samples stand out from the residuals beside them, however far off these are, and in the readings.

    For channels that are known to have spikes: where a model is far off, what is no spike may look alike.
    """
    off = np.abs(residuals - median_filter(residuals, size=AROUND))
    padded = np.pad(readings, ((0, 0), (2, 2)), mode="reflect", reflect_type="odd")
    beside = np.median([padded[:, k : k + readings.shape[1]] for k in (0, 1, 3, 4)], axis=0)
    return _stands_out(off, noise) & (np.abs(readings - beside) > JUMP * off)


def _stands_out(off: Array, noise: ChannelNoise) -> Mask:
    """Which of these sizes (S, n) are far beyond the noise, and beyond those beside them."""
    return np.asarray(off > OUTLIER * np.maximum(noise.std, 3.0 * median_filter(off, size=AROUND)))


def mains_lines(residual: Array, dt: float) -> tuple[float, ...]:
    """Frequencies [Hz] of mains and harmonics that stand out of a residual (N,) over a record, 0 where none is.

    The strongest first, each taken out before the next is sought: blocks that are left out give it side bands.
    """
    window, left = np.hanning(residual.size), residual.copy()
    frequency = np.fft.rfftfreq(residual.size, dt)
    width = max(2.0 / (residual.size * dt), 0.2)
    found, open_lines = list[float](), [m * h for m in MAINS for h in HARMONICS if m * h < 0.45 / dt]
    while True:
        power = np.abs(np.fft.rfft(left * window)) ** 2
        heights, places = {}, {}
        for line in open_lines:
            off = np.abs(frequency - line)
            at, beside = off <= width, (off > 2.0 * width) & (off <= 8.0)
            if at.any() and beside.any():
                heights[line] = float(power[at].max()) / max(float(np.median(power[beside])), 1e-300)
                places[line] = float(frequency[at][np.argmax(power[at])])
        highest = max(heights, key=lambda f: heights[f], default=None)
        if highest is None or heights[highest] <= STANDS_OUT:
            return tuple(sorted(found))
        found.append(highest)
        open_lines.remove(highest)
        angle = 2.0 * np.pi * places[highest] * dt * np.arange(residual.size)
        waves = np.stack((np.sin(angle), np.cos(angle)), axis=1)[residual != 0.0]
        left[residual != 0.0] -= waves @ np.linalg.lstsq(waves, left[residual != 0.0], rcond=None)[0]
