"""The best linear approximation of a nonlinear plant, and how much noise and distortion lie beside it.

Robust method [1, sec. 4.3.1]: M realisations of a random-phase multisine, P periods of each. What differs between
periods is noise; what differs between realisations, and not between periods, is nonlinear.

Detection lines [1, sec. 4.3.2]: of an odd multisine the even lines show even distortion, the odd lines that were left
out show odd distortion, in a single realisation.

Both work on the applied drive, which the centring of an experiment changes a little: what it puts on detection lines
is taken out of the output with the linear response.

[1] R. Pintelon, J. Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., Wiley 2012.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Complex, Index
from hydraulic_sysid.linear.errors import FrequencyResponseError

from .periodic import Periods


@dataclass(frozen=True)
class Lines:
    """Output at lines that were not played.

    Frequency (D,) [Hz], amplitude (D,) (RMS over realisations), the standard deviation (D,) of the noise in it.
    """

    frequency: Array
    amplitude: Array
    noise: Array


@dataclass(frozen=True)
class BestLinearApproximation:
    """The best linear approximation at the K lines that were played.

    ``noise`` and ``total`` (K,) are standard deviations of the response: from the periods, and from the realisations
    (None for a single one). ``output`` (K,) is the output's amplitude at the lines, ``output_noise`` (K,)
    the standard deviation of the part that the drive does not explain. ``odd`` and ``even`` are the detection lines,
    None where the excitation has none.
    """

    frequency: Array
    response: Complex
    noise: Array
    total: Array | None
    output: Array
    output_noise: Array
    odd: Lines | None
    even: Lines | None
    realisations: int
    periods: int

    @property
    def distortion(self) -> Array | None:
        """Standard deviation (K,) of the nonlinear part in one realisation, √M·√(total² − noise²).

        It is 0 where the noise hides it, and None for a single realisation.
        """
        if self.total is None:
            return None
        return np.sqrt(self.realisations * np.maximum(self.total**2 - self.noise**2, 0.0))

    @property
    def coherence(self) -> Array:
        """Squared coherence (K,) of one period, from the noise: |G|²/(|G|² + P·M·σ²)."""
        gain = np.abs(self.response) ** 2
        return gain / (gain + self.periods * self.realisations * self.noise**2)


def best_linear_approximation(records: Sequence[Periods]) -> BestLinearApproximation:
    """Robust method over the realisations, detection lines of each averaged over them.

    :raises FrequencyResponseError: no record, or records of unlike periods, lines or sampling.
    """
    if not records:
        raise FrequencyResponseError("there is no record of a periodic excitation")
    first = records[0]
    for other in records[1:]:
        same = other.drive.shape[1] == first.drive.shape[1] and other.dt == first.dt
        if not same or not np.array_equal(other.harmonics, first.harmonics):
            raise FrequencyResponseError(
                f"{other.name} and {first.name} differ in period, sampling or lines; realisations share all of them"
            )
    spectra = [_Spectra.of(record) for record in records]
    k = first.harmonics
    each = np.array([s.Y[k] / s.U[k] for s in spectra])
    response = each.mean(axis=0)
    count = len(records)
    noise = np.sqrt(np.mean([s.response_variance(k) for s in spectra], axis=0) / count)
    total = None
    if count > 1:
        total = np.sqrt(np.sum(np.abs(each - response) ** 2, axis=0) / (count * (count - 1)))
    frequency: Array = np.asarray(k * first.spacing, dtype=np.float64)
    odd, even = _detection_lines(spectra, frequency, response, k, first.spacing)
    return BestLinearApproximation(
        frequency=frequency,
        response=response,
        noise=noise,
        total=total,
        output=_rms([np.abs(s.Y[k]) for s in spectra]),
        output_noise=_rms([s.residual_deviation(k, response) for s in spectra]),
        odd=odd,
        even=even,
        realisations=count,
        periods=min(record.drive.shape[0] for record in records),
    )


@dataclass(frozen=True)
class _Spectra:
    """Mean amplitudes over the periods of one realisation, and the (co)variances of the means; all (N/2 + 1,)."""

    U: Complex
    Y: Complex
    var_u: Array
    var_y: Array
    cov: Complex

    @classmethod
    def of(cls, record: Periods) -> _Spectra:
        periods, size = record.drive.shape
        U, Y = (2.0 / size * np.fft.rfft(x, axis=1) for x in (record.drive, record.output))
        u, y = U.mean(axis=0), Y.mean(axis=0)
        freedom = periods * (periods - 1)
        return cls(
            U=u,
            Y=y,
            var_u=np.sum(np.abs(U - u) ** 2, axis=0) / freedom,
            var_y=np.sum(np.abs(Y - y) ** 2, axis=0) / freedom,
            cov=np.sum((Y - y) * np.conj(U - u), axis=0) / freedom,
        )

    def residual_deviation(self, lines: Index, response: Complex) -> Array:
        """Standard deviation of Y − G·U at the lines: what changes between periods and the drive does not explain."""
        explained = 2.0 * np.real(np.conj(response) * self.cov[lines]) - np.abs(response) ** 2 * self.var_u[lines]
        return np.sqrt(np.maximum(self.var_y[lines] - explained, 0.0))

    def response_variance(self, k: Index) -> Array:
        """Of Y/U at the lines, with what both have in common, [1] eq. (2-24)."""
        U, Y = self.U[k], self.Y[k]
        gain = np.abs(Y / U) ** 2
        shared = np.real(self.cov[k] / (Y * np.conj(U)))
        relative = self.var_y[k] / np.abs(Y) ** 2 + self.var_u[k] / np.abs(U) ** 2 - 2.0 * shared
        return np.maximum(gain * relative, 0.0)


def _detection_lines(
    spectra: Sequence[_Spectra], frequency: Array, response: Complex, k: Index, spacing: float
) -> tuple[Lines | None, Lines | None]:
    """Odd and even lines within the band that were not played; None where none was left out."""
    inside = np.setdiff1d(np.arange(k.min(), k.max() + 1), k)
    if np.any(k % 2 == 0) or not inside.size:
        return None, None  # an excitation that plays even lines has none on which only distortion falls
    found: list[Lines | None] = []
    for lines in (inside[inside % 2 == 1], inside[inside % 2 == 0]):
        if not lines.size:
            found.append(None)
            continue
        at = lines * spacing
        # jω·G varies slowly where G falls as 1/ω.
        slow = 2j * np.pi * frequency * response
        linear = (np.interp(at, frequency, slow.real) + 1j * np.interp(at, frequency, slow.imag)) / (2j * np.pi * at)
        left = [s.Y[lines] - linear * s.U[lines] for s in spectra]
        noise = [s.residual_deviation(lines, linear) for s in spectra]
        found.append(Lines(at, _rms([np.abs(x) for x in left]), _rms(noise)))
    return found[0], found[1]


def _rms(arrays: Sequence[Array]) -> Array:
    return np.sqrt(np.mean(np.square(arrays), axis=0))
