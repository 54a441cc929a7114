"""The relay experiment: critical gain and period measured on the plant itself, within limits that keep it safe.

A relay of ±d in the place of the controller makes the loop oscillate at its critical frequency; with the amplitude a of
that oscillation and the hysteresis ε of the relay,

    K_c = 4·d/(π·√(a² − ε²)),   T_c = period.

K. J. Åström, T. Hägglund, Automatic tuning of simple regulators with specifications on phase and amplitude margins,
Automatica 20 (1984) 645–651. On a plant whose damping depends on the opening of the valve the values hold for the
amplitude at which they were measured.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hydraulic_control.errors import ControlError
from hydraulic_interfaces.contract import DRIVE_LIMIT_V
from hydraulic_node_utils.parameter_spec import ParameterSpec

_DRIFT_GAIN = 0.2  # of the relay's amplitude: how far its centre may follow a drift


@dataclass(frozen=True)
class RelaySettings:
    """``amplitude`` d [V] and ``hysteresis`` ε [m] of the relay, and when it ends.

    That is after ``cycles`` that agree within ``agreement``; it is broken off beyond ``travel`` [m] from where it began
    or after ``time_limit`` [s].

    :raises ParameterError: a value lies outside its range (`SPECS`).
    """

    amplitude: float = 0.5
    hysteresis: float = 6e-5
    cycles: int = 10
    agreement: float = 0.2
    travel: float = 0.02
    time_limit: float = 10.0

    def __post_init__(self) -> None:
        for spec in SPECS:
            spec.check(getattr(self, spec.name))


SPECS = (
    ParameterSpec("amplitude", RelaySettings.amplitude, "of the relay", "V", 1e-3, DRIVE_LIMIT_V),
    ParameterSpec("hysteresis", RelaySettings.hysteresis, "of the relay: three times the noise", "m", 0.0, 0.1),
    ParameterSpec("cycles", RelaySettings.cycles, "that must agree", "", 3, 1000),
    ParameterSpec("agreement", RelaySettings.agreement, "of their periods and amplitudes", "1", 1e-3, 0.5),
    ParameterSpec("travel", RelaySettings.travel, "from the start, that breaks it off", "m", 1e-5, 10.0),
    ParameterSpec("time_limit", RelaySettings.time_limit, "that breaks it off", "s", 0.1, 600.0),
)


@dataclass(frozen=True)
class CriticalPoint:
    """Gain [V/m] at which the loop oscillates, and the period [s] of that oscillation."""

    gain: float
    period: float

    def as_document(self) -> dict[str, float]:
        """For JSON."""
        return {"critical_gain": self.gain, "critical_period": self.period}


@dataclass
class Relay:
    """The experiment, sample by sample: `step` gives the drive until `done`; then `result` or `trouble` is there."""

    settings: RelaySettings = field(default_factory=RelaySettings)
    done: bool = False
    trouble: str = ""
    result: CriticalPoint | None = None

    def __post_init__(self) -> None:
        self._time = 0.0
        self._start = self._high = self._low = math.nan
        self._out = self.settings.amplitude
        self._rises: list[float] = []
        self._peaks: list[float] = []
        self._centre = 0.0

    @property
    def cycles(self) -> int:
        """Whole cycles seen so far."""
        return max(len(self._rises) - 1, 0)

    def step(self, dt: float, position: float) -> float:
        """Drive [V] for a position [m] ``dt`` [s] after the last; 0 V once it is done."""
        if self.done:
            return 0.0
        s = self.settings
        if not (math.isfinite(position) and math.isfinite(dt) and dt >= 0.0):
            return self.abort("position or time is not a number")
        if math.isnan(self._start):
            self._start = self._high = self._low = position
        self._time += dt
        away = position - self._start
        if abs(away) > s.travel:
            return self.abort(f"travelled {away:.4g} m, allowed are ±{s.travel:g} m")
        if self._time > s.time_limit:
            return self.abort(f"no steady oscillation after {s.time_limit:g} s ({self.cycles} cycles)")
        self._high, self._low = max(self._high, position), min(self._low, position)
        self._switch(away)
        return 0.0 if self.done else self._out + self._bias(away)

    def abort(self, reason: str) -> float:
        """End it at 0 V; `trouble` says why."""
        self.done, self.trouble = True, reason
        return 0.0

    def _switch(self, away: float) -> None:
        s = self.settings
        if self._out > 0.0 and away > s.hysteresis:
            self._out = -s.amplitude
        elif self._out < 0.0 and away < -s.hysteresis:
            self._out = s.amplitude
            self._rises.append(self._time)
            self._peaks.append(0.5 * (self._high - self._low))
            self._high = self._low = self._start + away
            self._judge()

    def _bias(self, away: float) -> float:
        """A slow pull to the centre, so that an offset of the valve does not make the oscillation lopsided."""
        limit = _DRIFT_GAIN * self.settings.amplitude
        self._centre = min(max(self._centre - 1e-3 * limit * math.copysign(1.0, away), -limit), limit)
        return self._centre

    def _judge(self) -> None:
        s = self.settings
        if self.cycles < s.cycles:
            return
        periods, peaks = np.diff(self._rises[-s.cycles - 1 :]), np.array(self._peaks[-s.cycles :])
        if np.ptp(periods) > s.agreement * periods.mean() or np.ptp(peaks) > s.agreement * peaks.mean():
            return
        amplitude = float(peaks.mean())
        if amplitude <= s.hysteresis:
            self.abort(f"the oscillation of {amplitude:.2g} m does not leave the hysteresis of {s.hysteresis:g} m")
            return
        gain = 4.0 * s.amplitude / (math.pi * math.sqrt(amplitude**2 - s.hysteresis**2))
        self.result, self.done = CriticalPoint(gain, float(periods.mean())), True


def measure(plant: Any, settings: RelaySettings, dt: float = 1e-3) -> CriticalPoint:
    """Run the experiment on a plant in this process (`simulation.LoopPlant`).

    :raises ControlError: it was broken off.
    """
    relay, drive = Relay(settings), 0.0
    while not relay.done:
        position, _, _ = plant.step(drive, dt)
        drive = relay.step(dt, position)
    if relay.result is None:
        raise ControlError(f"relay experiment: {relay.trouble}")
    return relay.result
