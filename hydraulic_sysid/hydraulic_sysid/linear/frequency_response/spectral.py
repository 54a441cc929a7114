"""Frequency responses of any record: the empirical transfer function estimate, and Welch's with coherence.

Both are of the type H1 = S_uy/S_uu: noise on the output averages out, noise on the drive does not [1]. The output of
an integrating plant is taken as differences, whose response is known and divided out: the trend of a position would
leak into every line.

[1] L. Ljung, *System Identification: Theory for the User*, 2nd ed., Prentice Hall 1999, ch. 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from hydraulic_sim.arrays import Array, Complex, Mask
from hydraulic_sysid.linear.errors import FrequencyResponseError


@dataclass(frozen=True)
class Spectral:
    """A frequency response over lines.

    Frequency (K,) [Hz], response (K,) [output per input], coherence γ² (K,) between 0 and 1, power of the drive (K,)
    relative to its strongest line, and the number of independent averages behind each line.
    """

    frequency: Array
    response: Complex
    coherence: Array
    drive: Array
    averages: float

    @property
    def deviation(self) -> Array:
        """Standard deviation (K,) of the response from the coherence, |G|·√((1 − γ²)/(γ²·n)) [2].

        [2] J. S. Bendat, A. G. Piersol, *Random Data*, 4th ed., Wiley 2010, sec. 9.2 (magnitude and phase together).
        """
        safe = np.maximum(self.coherence, 1e-12)
        return np.abs(self.response) * np.sqrt(np.maximum(1.0 - self.coherence, 0.0) / (safe * self.averages))

    @property
    def played(self) -> Mask:
        """Which lines (K,) the drive reaches with at least 10⁻⁵ of the power of the strongest.

        Of others the coherence is that of leakage.
        """
        return self.drive >= 1e-5


def welch(drive: ArrayLike, output: ArrayLike, dt: float, segment: float, *, integrating: bool = True) -> Spectral:
    """Averaged over half-overlapping segments of `segment` [s] under a Hann window.

    :raises FrequencyResponseError: fewer than three segments lie in the record.
    """
    u, y = _pair(drive, output, integrating)
    count = round(segment / dt)
    if count < 8 or u.size < 2 * count:
        raise FrequencyResponseError(
            f"segment is {segment:g} s; allowed: from {8 * dt:g} s to half the record, {0.5 * u.size * dt:g} s"
        )
    options = {"fs": 1.0 / dt, "nperseg": count, "detrend": "constant"}
    frequency, s_uu = signal.welch(u, **options)
    _, s_yy = signal.welch(y, **options)
    _, s_uy = signal.csd(u, y, **options)
    segments = (u.size - count // 2) // (count - count // 2)
    # Half-overlapping Hann segments are worth 9/11 of as many independent ones (Welch 1967).
    return _spectral(frequency[1:], s_uu[1:], s_yy[1:], s_uy[1:], dt, integrating, segments * 9.0 / 11.0)


def etfe(drive: ArrayLike, output: ArrayLike, dt: float, width: float, *, integrating: bool = True) -> Spectral:
    """From the transform of the whole record, smoothed over `width` [Hz] by a Hann window, [1] eq. (6.51).

    The lines stay as fine as the record is long; what is narrower than `width` is smoothed away.

    :raises FrequencyResponseError: `width` is below three lines, or above the Nyquist frequency.
    """
    u, y = _pair(drive, output, integrating)
    spacing = 1.0 / (u.size * dt)
    half = round(width / spacing)
    if half < 1 or width > 0.5 / dt:
        raise FrequencyResponseError(f"width is {width:g} Hz; allowed: {spacing:g} … {0.5 / dt:g} Hz")
    U, Y = np.fft.rfft(u - u.mean())[1:], np.fft.rfft(y - y.mean())[1:]
    window = signal.windows.hann(2 * half + 1, sym=True)
    window /= window.sum()

    def smooth(values: Any) -> Any:
        return signal.oaconvolve(values, window, mode="same")

    frequency: Array = spacing * np.arange(1, U.size + 1, dtype=np.float64)
    s_uu, s_yy = np.abs(smooth(np.abs(U) ** 2)), np.abs(smooth(np.abs(Y) ** 2))
    return _spectral(frequency, s_uu, s_yy, smooth(np.conj(U) * Y), dt, integrating, 1.0 / float(np.sum(window**2)))


def _spectral(
    frequency: Array, s_uu: Array, s_yy: Array, s_uy: Complex, dt: float, integrating: bool, averages: float
) -> Spectral:
    floor = 1e-12 * float(s_uu.max())  # lines that were not played: nothing is known of them
    keep = s_uu > floor
    with np.errstate(divide="ignore", invalid="ignore"):
        response = np.where(keep, s_uy / s_uu, np.nan)
        coherence = np.where(keep & (s_yy > 0.0), np.abs(s_uy) ** 2 / (s_uu * s_yy), 0.0)
    if integrating:
        response = response / (np.exp(2j * np.pi * frequency * dt) - 1.0)
    return Spectral(frequency, response, np.clip(coherence, 0.0, 1.0), s_uu / s_uu.max(), averages)


def _pair(drive: ArrayLike, output: ArrayLike, integrating: bool) -> tuple[Array, Array]:
    u, y = np.asarray(drive, dtype=float), np.asarray(output, dtype=float)
    if u.shape != y.shape or u.ndim != 1 or u.size < 16:
        raise FrequencyResponseError(f"drive {u.shape} and output {y.shape} must be equal, one-dimensional, 16 or more")
    if not (np.ptp(u) > 0.0):
        raise FrequencyResponseError("the drive does not move: nothing is excited")
    return (u[:-1], np.diff(y)) if integrating else (u, y)
