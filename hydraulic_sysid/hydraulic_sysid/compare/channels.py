"""The measured channels of a record as the comparison uses them.

The velocity is the derivative of the measured position by a Savitzky–Golay filter (cubic, zero phase, its length
chosen by the record's own noise and motion): the sensor does not measure it. The simulated position passes
the same filter, so that the filter's bandwidth is in both and not in their difference. The load pressure is
the force of the pressures over the area of side A, p_A − p_B·A_b/A_a.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_coeffs, savgol_filter

from hydraulic_sim.model_file import Model
from hydraulic_sysid.noise import noise_floor
from hydraulic_sysid.records import Record

Array = NDArray[np.float64]

UNITS = {
    "position": "m",
    "velocity": "m/s",
    "pressure_a": "Pa",
    "pressure_b": "Pa",
    "load_pressure": "Pa",
    "pressure_supply": "Pa",
    "spool": "1",
    "drive": "V",
}
"""Channels in the order of tables and plots, with their SI unit."""

COMPARED = ("position", "velocity", "pressure_a", "pressure_b", "load_pressure", "pressure_supply", "spool")
SPANS = (0.008, 0.012, 0.016, 0.02, 0.025, 0.03, 0.04, 0.05, 0.065, 0.08)
"""Lengths in seconds that the derivative filter may have."""
_CUBIC = 3
_NUMERICAL = 1e-6  # of the largest value: what a record without noise is not held to


@dataclass(frozen=True)
class VelocityFilter:
    """Savitzky–Golay derivative (cubic) over ``window`` samples (odd) of ``dt`` seconds."""

    dt: float
    window: int

    @classmethod
    def for_signal(cls, position: Array, dt: float, sigma: float) -> VelocityFilter:
        """The window with the smallest expected squared error of the velocity.

        A long window suppresses noise, a short one follows fast motion. Against the shortest window r, which
        follows best, the error of another one w is estimated without bias as mean (v_w − v_r)² − σ²·|r|² +
        2·σ²·r·w with the filters' weights r, w and the position's noise ``sigma`` (as Mallows' C_p,
        Technometrics 15 (1973) 661–675).
        """
        windows = sorted({max(5, 2 * int(round(span / dt / 2.0)) + 1) for span in SPANS})
        windows = [w for w in windows if 3 * w <= position.size] or windows[:1]
        filters = [cls(dt, w) for w in windows]
        shortest = filters[0]
        reference, weights = shortest(position), shortest.weights
        risks = []
        for candidate in filters:
            inner = slice(candidate.window, -candidate.window)
            gap = float(np.mean((candidate(position) - reference)[inner] ** 2))
            margin = (candidate.window - shortest.window) // 2
            shared = float(weights @ candidate.weights[margin : margin + shortest.window])
            risks.append(gap + sigma**2 * (2.0 * shared - float(weights @ weights)))
        return filters[int(np.argmin(risks))]

    def __call__(self, position: Array) -> Array:
        """Velocity along the last axis; same shape."""
        return savgol_filter(position, self.window, _CUBIC, deriv=1, delta=self.dt, axis=-1)

    @property
    def weights(self) -> Array:
        """``(window,)`` weights of the filter in the middle of a signal."""
        return savgol_coeffs(self.window, _CUBIC, deriv=1, delta=self.dt)

    @property
    def noise_gain(self) -> float:
        """Standard deviation of the velocity over that of white noise on the position, in 1/s."""
        return float(np.linalg.norm(self.weights))

    @property
    def half(self) -> int:
        """Samples that the filter needs on either side."""
        return self.window // 2


def load_pressure(pressure_a: Array, pressure_b: Array, model: Model) -> Array:
    """p_A − p_B·A_b/A_a: the pressures' force over the area of side A."""
    return pressure_a - pressure_b * (model.value("piston_area_b") / model.value("piston_area_a"))


@dataclass(frozen=True)
class Measured:
    """A record's channels, those that follow from them, and their noise floors."""

    record: Record
    channels: dict[str, Array]
    noise: dict[str, float]
    velocity_filter: VelocityFilter

    @property
    def compared(self) -> tuple[str, ...]:
        """Channels that can be set against the model."""
        return tuple(name for name in COMPARED if name in self.channels)


def measured(record: Record, model: Model, to_velocity: VelocityFilter | None = None) -> Measured:
    """Channels, derived channels and noise floors of a record that has at least ``drive`` and ``position``.

    ``to_velocity`` fixes the derivative filter; otherwise the record's own noise and motion choose it.
    """
    channels = {name: record[name] for name in UNITS if name in record and name != "velocity"}
    if "spool" in channels:
        channels["spool"] = channels["spool"] / model.value("spool_travel")
    noise = {name: _noise(values) for name, values in channels.items()}
    to_velocity = to_velocity or VelocityFilter.for_signal(channels["position"], record.dt, noise["position"])
    channels["velocity"] = to_velocity(record["position"])
    noise["velocity"] = noise["position"] * to_velocity.noise_gain
    if "pressure_a" in channels and "pressure_b" in channels:
        channels["load_pressure"] = load_pressure(channels["pressure_a"], channels["pressure_b"], model)
        noise["load_pressure"] = _noise(channels["load_pressure"])
    return Measured(record, channels, noise, to_velocity)


def _noise(values: Array) -> float:
    return max(noise_floor(values), _NUMERICAL * float(np.abs(values).max()))
