"""An excitation from a band: the plan of every kind of signal, at 1 V, before its amplitude is found.

Bands are 0.1 … 2 times the bandwidth [1] unless the user says otherwise. Periodic signals are played in whole periods,
with one more to settle in.

[1] Z. Nisar, H. Munawar, "System Identification and Controller Design for Hydraulic Actuator".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from hydraulic_sysid.excitation.errors import ExcitationError
from hydraulic_sysid.excitation.plan import Plan
from hydraulic_sysid.excitation.signals import Signal
from hydraulic_sysid.excitation.signals.chirp import Chirp
from hydraulic_sysid.excitation.signals.multisine import Multisine
from hydraulic_sysid.excitation.signals.odd_random_phase_multisine import OddRandomPhaseMultisine
from hydraulic_sysid.excitation.signals.prbs import Prbs
from hydraulic_sysid.excitation.signals.random_phase_multisine import RandomPhaseMultisine
from hydraulic_sysid.excitation.signals.sawtooth import Sawtooth
from hydraulic_sysid.excitation.signals.sine import Sine
from hydraulic_sysid.excitation.signals.square import Square
from hydraulic_sysid.excitation.signals.staircase import Staircase
from hydraulic_sysid.excitation.signals.steps import Steps
from hydraulic_sysid.excitation.signals.triangle import Triangle

_FADE_S = 0.5
_APPROACH_S = 8.0  # from anywhere in the stroke, whatever was played before
_PERIODS = 4  # of a periodic signal within the duration, one of them to settle in
_PRBS_3_DB = 0.44  # of the clock frequency, where the power of a binary sequence is 3 dB down
_HARMONICS = 5.0  # a wave with corners reaches to the end of the band with its fifth harmonic


@dataclass(frozen=True)
class Wish:
    """What is wished for.

    The band [Hz], the bandwidth it came from [Hz], the length of the signal [s], the rate [Hz], the seed, and how many
    periods of a periodic signal fit in the length.
    """

    low: float
    high: float
    duration: float = 50.0
    rate: float = 1000.0
    seed: int = 1
    periods: int = _PERIODS

    @property
    def middle(self) -> float:
        """The paper's middle tone, half the bandwidth: a quarter of the upper end of 0.1 … 2."""
        return 0.25 * self.high

    @property
    def period(self) -> float:
        """A whole number of samples, with `periods` of it and the fades in the duration."""
        return math.floor((self.duration - 2.0 * _FADE_S) / self.periods * self.rate) / self.rate


def _prbs(wish: Wish) -> Signal:
    clock = max(1, round(_PRBS_3_DB / wish.high * wish.rate)) / wish.rate
    order = max(3, math.ceil(math.log2(1.0 / (wish.low * clock) + 1.0)))
    return Prbs(amplitude=1.0, clock=clock, order=min(order, 20), seed=wish.seed)


def _steps(wish: Wish) -> Signal:
    return Steps(levels=(1.0, -1.0, -1.0, 1.0), hold=0.25 * min(wish.duration - 2 * _FADE_S, 1.0 / wish.low))


SIGNALS: dict[str, Callable[[Wish], Signal]] = {
    "chirp": lambda w: Chirp(1.0, w.low, w.high, w.duration, "exponential", 0.5 * math.pi),
    "linear_chirp": lambda w: Chirp(1.0, w.low, w.high, w.duration, "linear", 0.5 * math.pi),
    "three_tones": lambda w: Multisine((w.low, w.middle, w.high), (1.0,)),
    "random_phase_multisine": lambda w: RandomPhaseMultisine(0.2, w.period, w.low, w.high, w.seed),
    "low_crest_multisine": lambda w: RandomPhaseMultisine(0.2, w.period, w.low, w.high, w.seed, "low"),
    "odd_random_phase_multisine": lambda w: OddRandomPhaseMultisine(0.2, w.period, w.low, w.high, seed=w.seed),
    "prbs": _prbs,
    "step": _steps,
    "staircase": lambda w: Staircase(1.0, max(0.5 / w.high, 2.0 / w.rate), 4),
    "sine": lambda w: Sine(1.0, 0.5 * w.high, 0.5 * math.pi),
    "triangle": lambda w: Triangle(1.0, max(w.high / _HARMONICS, w.low)),
    "square": lambda w: Square(1.0, max(w.high / _HARMONICS, w.low), 0.25),
    "sawtooth": lambda w: Sawtooth(1.0, max(w.high / _HARMONICS, w.low)),
}
"""Name of a design → the signal of a wish, of about 1 V."""


def propose(name: str, wish: Wish) -> Plan:
    """The plan of a design at about 1 V; its amplitude is found with `amplitude.largest`.

    :raises ExcitationError: no such design, or a band that does not fit the duration or the rate.
    """
    if name not in SIGNALS:
        raise ExcitationError(f"signal {name!r} is none of {', '.join(SIGNALS)}")
    if not 0.0 < wish.low < wish.high:
        raise ExcitationError(f"the band is {wish.low:g} … {wish.high:g} Hz; both positive, the lower end first")
    if wish.duration <= 2.0 * _FADE_S + 1.0:
        raise ExcitationError(f"duration is {wish.duration:g} s; allowed: more than {2.0 * _FADE_S + 1.0:g} s")
    signal = SIGNALS[name](wish)
    sharp = name in ("step", "staircase", "square", "prbs")
    fade = 0.0 if sharp else _FADE_S
    return Plan(
        name=name,
        description=f"{name.replace('_', ' ')}, {wish.low:.3g} to {wish.high:.3g} Hz",
        signal=signal,
        travel_limit=100.0,
        duration=wish.duration,
        rate=wish.rate,
        fade_in=fade,
        fade_out=fade,
        approach=_APPROACH_S,
    )
