"""What sensors and logger make of the channels: coloured noise, mains hum, converters, spikes, channels that are late.

Noise is drawn before a run, since the controller reads it too; transducers, converters and the logger's faults come
after it and change the recorded channels alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, lfilter, lfiltic

RATE = 1000.0  # Hz
DAMPING = math.sqrt(0.5)  # of every second-order low pass
FAR = 8.0  # a transducer's corner over the plant's resonance, from which its low pass does not matter
SETTLE = 2000  # samples of noise before the record, in which a filter forgets its start
RANGES = (10e6, 16e6, 25e6, 40e6)  # Pa, pressure transducers that one can buy
MARGIN = 1.1  # of a transducer's range over the supply
HARMONIC = 0.15  # third harmonic of the mains over its fundamental


@dataclass(frozen=True)
class Sensors:
    """``corners``: of the low pass on the noise of position and pressures [Hz]; ``transducer``: of that on the
    pressures themselves [Hz]; ``hum``: rms of the mains over the noise of each pressure; ``bits`` of the pressures'
    converters over the range of their transducers; ``spikes``: share of the samples of each channel, and
    ``spike_size`` over the noise; ``noise``: of the pressures, over that of the geometry. 0: none."""

    corners: tuple[float, float] = (0.0, 0.0)
    transducer: float = 0.0
    hum: tuple[float, float] = (0.0, 0.0)
    bits: int = 0
    spikes: float = 0.0
    spike_size: float = 50.0
    noise: float = 1.0


WHITE = Sensors()


def _white(rng: np.random.Generator, resonance: float) -> Sensors:
    return WHITE


def _filtered(rng: np.random.Generator, resonance: float) -> Sensors:
    corners = tuple(np.exp(rng.uniform(math.log(100.0), math.log(400.0), 2)).tolist())
    return Sensors(corners, corners[1] if corners[1] >= FAR * resonance else 0.0)


def _hum(rng: np.random.Generator, resonance: float) -> Sensors:
    rms = math.exp(rng.uniform(math.log(0.5), math.log(3.0)))
    return Sensors(hum=tuple((rms * rng.uniform(0.7, 1.0, 2)).tolist()))


def _converter(rng: np.random.Generator, resonance: float) -> Sensors:
    return Sensors(bits=12, noise=rng.uniform(0.1, 0.5))


def _spiky(rng: np.random.Generator, resonance: float) -> Sensors:
    return Sensors(spikes=rng.uniform(5e-4, 1e-3))


def _real(rng: np.random.Generator, resonance: float) -> Sensors:
    """Of everything a little, as on a bench in a hall."""
    corners = (rng.uniform(200.0, 300.0), rng.uniform(120.0, 200.0))
    hum = rng.uniform(0.5, 1.0, 2)
    return Sensors(corners, 400.0 if resonance * FAR <= 400.0 else 0.0, tuple(hum.tolist()), 12)


KINDS = {"white": _white, "filtered": _filtered, "hum": _hum, "converter": _converter, "spiky": _spiky, "real": _real}


def draw(kind: str, rng: np.random.Generator, resonance: float) -> Sensors:
    """The sensors of one bench; ``resonance`` of its oil [Hz]."""
    return KINDS[kind](rng, resonance)


def noise(sensors: Sensors, rng: np.random.Generator, sizes: np.ndarray, samples: int) -> np.ndarray:
    """Noise (3, n) of position [m] and both pressures [Pa] of these ``sizes`` (3,), hum included."""
    sizes = sizes * np.array([1.0, sensors.noise, sensors.noise])
    corners = (sensors.corners[0], sensors.corners[1], sensors.corners[1])
    if any(corners):
        found = rng.standard_normal((3, samples + SETTLE))
        for row, corner in zip(found, corners, strict=True):
            if corner:
                numerator, denominator = low_pass(corner)
                row[:] = lfilter(numerator, denominator, row)
                row /= row[SETTLE:].std()
        found = found[:, SETTLE:] * sizes[:, None]
    else:
        found = rng.standard_normal((3, samples)) * sizes[:, None]
    if any(sensors.hum):
        mains = 2.0 * np.pi * (50.0 + rng.uniform(-0.03, 0.03)) * np.arange(samples) / RATE
        phases = rng.uniform(0.0, 2.0 * np.pi, (2, 2))
        for row, size, rms, (first, third) in zip(found[1:], sizes[1:], sensors.hum, phases, strict=True):
            wave = np.sin(mains + first) + HARMONIC * np.sin(3.0 * mains + third)
            row += math.sqrt(2.0) * rms * size * wave
    return found


def seen(
    sensors: Sensors,
    rng: np.random.Generator,
    channels: np.ndarray,
    noise: np.ndarray,
    sizes: np.ndarray,
    supply: float,
) -> np.ndarray:
    """Channels (3, n) as recorded, from those that the sensors would give with their ``noise`` (3, n) alone.

    :param sizes: of the noise (3,)
    :param supply: pressure that the transducers are bought for [Pa]
    """
    found = channels.copy()
    if sensors.transducer:
        numerator, denominator = low_pass(sensors.transducer)
        for row, added in zip(found[1:], noise[1:], strict=True):
            signal = row - added
            start = lfiltic(numerator, denominator, np.full(2, signal[0]), np.full(2, signal[0]))
            row[:] = lfilter(numerator, denominator, signal, zi=start)[0] + added
    if sensors.bits:
        step = next(r for r in RANGES if r >= MARGIN * supply) / 2**sensors.bits
        found[1:] = step * np.floor(found[1:] / step + 0.5)
    if sensors.spikes:
        for row, size in zip(found, sizes, strict=True):
            spiked(row, rng, sensors.spikes, sensors.spike_size * size)
    return found


def spiked(row: np.ndarray, rng: np.random.Generator, share: float, size: float) -> None:
    """Throw a ``share`` of the samples off by about ``size`` to either side, in place."""
    places = np.flatnonzero(rng.random(len(row)) < share)
    row[places] += size * rng.choice((-1.0, 1.0), len(places)) * rng.uniform(0.8, 1.2, len(places))


def late(row: np.ndarray, samples: int) -> np.ndarray:
    """A channel recorded that many samples late; before its first sample it stood still."""
    return row[np.maximum(np.arange(len(row)) - samples, 0)]


def low_pass(corner: float) -> tuple[np.ndarray, np.ndarray]:
    """Second-order low pass (Butterworth, Hz) on samples that are joined by straight lines."""
    w = 2.0 * np.pi * corner
    numerator, denominator, _ = cont2discrete(([w * w], [1.0, 2.0 * DAMPING * w, w * w]), 1.0 / RATE, "foh")
    return np.ravel(numerator), np.ravel(denominator)
