"""What "the bandwidth" of an integrating plant means.

A servo valve with an actuator integrates: its position response falls as 1/ω from the start and has no −3 dB
frequency. Two definitions are left.

*Velocity bandwidth*: the first frequency at which the velocity response |jω·G(jω)| lies 3 dB below its value at low
frequencies. It says how fast valve and oil follow, and lies beyond the hydraulic resonance.

*Position bandwidth*: the first frequency at which the closed position loop T = K·G/(1 + K·G) under proportional control
lies 3 dB below 1, with K half the critical gain (where the phase of G passes −180°): the gain of Ziegler and Nichols
[1], a gain margin of 6 dB. It says how fast the actuator can be told to move, with the damping it has.

The excitation is chosen from the *position bandwidth*. The models are made for position control, which acts up to
there; 0.1 … 2 times the velocity bandwidth would be 6 … 110 Hz, where the piston moves by fractions of a millimetre and
a model sampled every 50 ms sees nothing.

The critical gain rests on the damping of the hydraulic resonance, and so does the position bandwidth. At rest, without
dry friction, the damping is least; friction and an open valve add to it. A probe of some amplitude therefore measures a
larger position bandwidth than the linearised model has, which is the one that a controller may count on everywhere.

[1] J. G. Ziegler, N. B. Nichols, "Optimum settings for automatic controllers", Trans. ASME 64, 1942, pp. 759–768.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array, Complex, Mask

GAIN_SHARE = 0.5
"""Of the critical gain, with which the position loop is closed."""
_MINUS_3_DB = 1.0 / np.sqrt(2.0)
_DENSE = 10  # points between two lines
_LOW = 3.0  # lines up to so many times the lowest count as low frequencies


class BandwidthError(HydraulicError, ValueError):
    """The response does not reach where the bandwidth is; the message says which end is missing."""


@dataclass(frozen=True)
class Bandwidth:
    """Both bandwidths [Hz], the gains behind them, and the response they were taken from; the velocity's is NaN where
    the response ends before it.

    ``velocity_gain`` [m/(s·V)] at low frequencies, ``critical_gain`` [V/m] at ``phase_crossover`` [Hz], ``frequency``
    (K,) [Hz], ``response`` (K,) drive to position [m/V], ``closed_loop`` (K,).
    """

    position: float
    velocity: float
    velocity_gain: float
    critical_gain: float
    phase_crossover: float
    frequency: Array
    response: Complex

    @property
    def closed_loop(self) -> Complex:
        """T (K,) of the position loop at the proportional gain used."""
        loop = GAIN_SHARE * self.critical_gain * self.response
        return loop / (1.0 + loop)

    def band(self, low: float = 0.1, high: float = 2.0) -> tuple[float, float]:
        """Band of an excitation [Hz], as parts of the position bandwidth."""
        return low * self.position, high * self.position


def from_response(frequency: Array, response: Complex) -> Bandwidth:
    """Bandwidths of the response (K,) [m/V] at rising frequencies (K,) [Hz].

    :raises BandwidthError: the response ends before its phase has passed −180°, or begins above the position bandwidth.
    """
    velocity = 2j * np.pi * frequency * response
    low = frequency <= _LOW * frequency[0]
    gain = float(np.abs(np.mean(velocity[low])))
    dense, v = _dense(frequency, velocity)
    g = v / (2j * np.pi * dense)
    phase = np.unwrap(np.angle(v)) - np.pi / 2
    phase -= 2 * np.pi * np.round((phase[0] + np.pi / 2) / (2 * np.pi))  # an integrator begins at −90°
    crossover = _first(phase <= -np.pi)
    if crossover is None:
        raise BandwidthError(
            f"up to {frequency[-1]:g} Hz the phase does not pass −180°: no critical gain; measure to higher frequencies"
        )
    critical = 1.0 / float(np.abs(g[crossover]))
    loop = GAIN_SHARE * critical * g
    position = _first(np.abs(loop / (1.0 + loop)) < _MINUS_3_DB)
    if position is None or position == 0:
        raise BandwidthError(
            f"the position loop is not 3 dB down within {frequency[0]:g} … {frequency[-1]:g} Hz; measure to "
            f"{'higher' if position is None else 'lower'} frequencies"
        )
    velocity_end = _first(np.abs(v) < _MINUS_3_DB * gain)
    return Bandwidth(
        position=float(dense[position]),
        velocity=float("nan") if velocity_end is None else float(dense[velocity_end]),
        velocity_gain=gain,
        critical_gain=critical,
        phase_crossover=float(dense[crossover]),
        frequency=frequency,
        response=response,
    )


def _dense(frequency: Array, velocity: Complex) -> tuple[Array, Complex]:
    """The velocity response between its lines, by straight lines in the complex plane over the frequency."""
    at = np.arange((frequency.size - 1) * _DENSE + 1) / _DENSE
    f = np.interp(at, np.arange(frequency.size), frequency)
    return f, np.interp(f, frequency, velocity.real) + 1j * np.interp(f, frequency, velocity.imag)


def _first(where: Mask) -> int | None:
    """Index from which a condition holds for at least the distance of two lines: a single line may be noise."""
    runs = np.convolve(where, np.ones(2 * _DENSE + 1), mode="valid") > 2 * _DENSE + 0.5
    found = np.flatnonzero(runs)
    return int(found[0]) if found.size else None
