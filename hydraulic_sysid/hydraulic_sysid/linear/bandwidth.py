"""The bandwidth of an integrating plant: what it means, of a model, of a probe's record, and as a result document.

A servo valve with an actuator integrates: its position response falls as 1/ω from the start and has no −3 dB
frequency. Two definitions are left.

*Velocity bandwidth*: the first frequency at which the velocity response |jω·G(jω)| lies 3 dB below its value at low
frequencies. It says how fast valve and oil follow, and lies beyond the hydraulic resonance.

*Position bandwidth*: the first frequency at which the closed position loop T = K·G/(1 + K·G) under proportional control
lies 3 dB below 1, with K half the critical gain (where the phase of G passes −180°): the gain of Ziegler and Nichols
[1], a gain margin of 6 dB. It says how fast the actuator can be commanded to move, with the damping it has.

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
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array, Complex, Mask
from hydraulic_sim.linear import linearise
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.simulated_run import simulate_plan
from hydraulic_sysid.linear.errors import BandwidthError
from hydraulic_sysid.linear.frequency_response import best_linear_approximation, periods_of

GAIN_SHARE = 0.5
"""Of the critical gain, with which the position loop is closed."""
_MINUS_3_DB = 1.0 / np.sqrt(2.0)
_DENSE = 10  # points between two lines
_LOW = 3.0  # lines up to so many times the lowest count as low frequencies


_DEVIATION = 0.25  # of the response, above which a line is not used
_FEWEST = 20
_LOWEST_HZ, _HIGHEST_HZ, _POINTS = 1e-3, 1e3, 12001


@dataclass(frozen=True)
class Bandwidth:
    """Both bandwidths [Hz], the gains behind them, and the response they were taken from.

    The velocity's bandwidth is NaN where the response ends before it.
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


def from_model(model: Model, position: float = 0.0) -> Bandwidth:
    """Of the model linearised around rest at `position` [m]; dry friction has no linear part.

    :raises SimulationError: no steady state there.
    :raises BandwidthError: outside 1 mHz … 1 kHz.
    """
    frequency = np.geomspace(_LOWEST_HZ, _HIGHEST_HZ, _POINTS).astype(np.float64)
    system = linearise(model, position)
    response = np.asarray(system(2j * np.pi * frequency)).reshape(-1, frequency.size)[0]
    return from_response(frequency, response)


def from_simulation(model: Model, plan: Plan) -> tuple[Bandwidth, np.ndarray]:
    """Of the model under a probe's plan, with friction and the damping that an open valve has.

    :raises BandwidthError: as `from_record`, or the plan leaves its travel.
    """
    played = simulate_plan(plan, Plant(model))
    if played.aborted:
        raise BandwidthError(f"{plan.name} on {model.name}: {played.aborted}")
    return from_record(played.record)


def from_record(record: Record, period: float | None = None, start: float = 0.0) -> tuple[Bandwidth, np.ndarray]:
    """Of the record of a periodic excitation, and the coherence (K,) of the lines used.

    Lines are used whose response has a standard deviation of at most a quarter of it.

    :raises FrequencyResponseError: no whole periods in the record.
    :raises BandwidthError: too few lines stand out of the noise, or they do not reach the bandwidth.
    """
    response = best_linear_approximation([periods_of(record, period=period, start=start)])
    good = response.noise <= _DEVIATION * np.abs(response.response)
    if np.count_nonzero(good) < _FEWEST:
        raise BandwidthError(
            f"{record.name}: only {np.count_nonzero(good)} of {good.size} lines stand out of the noise (needed: "
            f"{_FEWEST}); excite more strongly or longer"
        )
    return from_response(response.frequency[good], response.response[good]), response.coherence[good]


def document(found: Bandwidth, source: dict[str, Any], coherence: np.ndarray | None = None) -> dict[str, Any]:
    """The result document; ``source`` says what it was taken from (``kind``, ``name``, ``path``)."""
    low, high = found.band()
    reach = f"to {found.velocity:.3g} Hz" if np.isfinite(found.velocity) else f"beyond {found.frequency[-1]:.3g} Hz"
    text = (
        f"Position bandwidth {found.position:.3g} Hz: excite from {low:.2g} to {high:.3g} Hz (0.1 … 2 times). "
        f"The velocity follows {reach}."
    )
    return {
        **heading("bandwidth", 2),
        "verdict": {"level": "explained", "text": text},
        "title": f"Bandwidth of {source['name']}",
        "model": {"name": source["name"]},
        "source": source,
        "position_bandwidth": found.position,
        "velocity_bandwidth": found.velocity,
        "velocity_gain": found.velocity_gain,
        "critical_gain": found.critical_gain,
        "gain_share": GAIN_SHARE,
        "phase_crossover": found.phase_crossover,
        "excitation_band": [low, high],
        "frequency": found.frequency,
        "response": {"real": found.response.real, "imaginary": found.response.imag},
        "closed_loop": {"magnitude": np.abs(found.closed_loop), "phase": np.unwrap(np.angle(found.closed_loop))},
        "coherence": coherence,
    }


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
