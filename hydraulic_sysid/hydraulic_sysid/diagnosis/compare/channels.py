"""The measured channels of a record as the comparison uses them.

The velocity is the derivative of the measured position by a Savitzky–Golay filter (cubic, zero phase, its length
chosen by the record's own noise and motion): the sensor does not measure it. The simulated position passes
the same filter, so that the filter's bandwidth is in both and not in their difference. The load pressure is
the force of the pressures over the area of side A, p_A − p_B·A_b/A_a.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.model_file import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.noise import noise_std
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

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
_NUMERICAL = 1e-6  # of the largest value: what a record without noise is not held to


@dataclass(frozen=True)
class Scales:
    """What turns measured channels into those that are compared: A_b/A_a (None: unknown), spool travel [m]."""

    area_ratio: float | None
    spool_travel: float

    @classmethod
    def of(cls, model: Model) -> Scales:
        """Those of a model file."""
        return cls(model.value("piston_area_b") / model.value("piston_area_a"), model.value("spool_travel"))

    def with_load_pressure(self, channels: dict[str, Array]) -> dict[str, Array]:
        """The channels and p_A − p_B·A_b/A_a, the pressures' force over the area of side A, where it is known."""
        if self.area_ratio is None or not {"pressure_a", "pressure_b"} <= channels.keys():
            return channels
        return {**channels, "load_pressure": channels["pressure_a"] - channels["pressure_b"] * self.area_ratio}


@dataclass(frozen=True)
class Measured:
    """A record's channels, those that follow from them, and the standard deviations of their noise."""

    record: Record
    channels: dict[str, Array]
    noise: dict[str, float]
    velocity_filter: VelocityFilter

    @property
    def compared(self) -> tuple[str, ...]:
        """Channels that can be set against the model."""
        return tuple(name for name in COMPARED if name in self.channels)


def measured(record: Record, scales: Scales, to_velocity: VelocityFilter | None = None) -> Measured:
    """Channels, derived channels and noise of a record that has at least ``drive`` and ``position``.

    ``to_velocity`` fixes the derivative filter; otherwise the record's own noise and motion choose it.
    """
    channels = {name: record[name] for name in UNITS if name in record and name != "velocity"}
    if "spool" in channels:
        channels["spool"] = channels["spool"] / scales.spool_travel
    noise = {name: _noise(values) for name, values in channels.items()}
    to_velocity = to_velocity or VelocityFilter.for_signal(channels["position"], record.dt, noise["position"])
    channels["velocity"] = to_velocity(record["position"])
    noise["velocity"] = noise["position"] * to_velocity.noise_gain
    channels = scales.with_load_pressure(channels)
    if "load_pressure" in channels:
        noise["load_pressure"] = _noise(channels["load_pressure"])
    return Measured(record, channels, noise, to_velocity)


def _noise(values: Array) -> float:
    return max(noise_std(values), _NUMERICAL * float(np.abs(values).max()))
