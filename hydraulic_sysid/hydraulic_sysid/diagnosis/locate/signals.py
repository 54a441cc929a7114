"""What directions are made from: the record's own signals, smoothed, at the middle of every sampling interval."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from hydraulic_sim.arrays import Array
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

from .balances import Residuals, root
from .path import Path

_CUBIC = 3
_MOVING = 3.0  # standard deviations of the velocity's noise at which a piston surely moves


@dataclass(frozen=True)
class Signals:
    """Arrays ``(n,)`` in SI. ``hydraulic`` is False for a plant without oil, whose pressure signals are zero.

    ``gain_a``, ``gain_b``: flow into each chamber per opening; ``centre_a``, ``centre_b``: flow into each chamber per
    opening of both of its lands; ``supply_a`` … ``tank_b``: per supply and return pressure.
    """

    plant: Plant
    hydraulic: bool
    dt: float
    time: Array
    position: Array
    velocity: Array
    direction: Array
    drive: Array
    """Demanded opening or force of the drive, −1…1."""
    opening: Array
    pressure_a: Array
    pressure_b: Array
    rate_a: Array
    rate_b: Array
    capacity_a: Array
    capacity_b: Array
    flow_a: Array
    flow_b: Array
    pressure_supply: Array
    path: Path

    @property
    def load_pressure(self) -> Array:
        return self.pressure_a - self.pressure_b * (
            self.plant.value("piston_area_b") / self.plant.value("piston_area_a") if self.hydraulic else 1.0
        )

    @property
    def _land(self) -> float:
        return self.plant.value("valve_flow") / np.sqrt(self.plant.value("valve_drop"))

    def _root(self, drop: Array) -> Array:
        return root(drop, self.plant.value("orifice_transition"))

    def _slope(self, drop: Array) -> Array:
        return 0.5 / np.sqrt(np.abs(drop) + self.plant.value("orifice_transition"))

    def drops(self) -> tuple[Array, Array, Array, Array]:
        """Over the lands: supply to A, A to return, supply to B, B to return [Pa]."""
        tank, supply = self.plant.value("tank_pressure"), self.pressure_supply
        return supply - self.pressure_a, self.pressure_a - tank, supply - self.pressure_b, self.pressure_b - tank

    def opening_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B per opening [m³/s], on the side that is open."""
        pa, at, pb, bt = (self._root(d) for d in self.drops())
        out = self.opening >= 0.0
        return self._land * np.where(out, pa, at), -self._land * np.where(out, bt, pb)

    def centre_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B when both lands of a chamber open [m³/s per opening]."""
        pa, at, pb, bt = (self._root(d) for d in self.drops())
        return self._land * (pa - at), self._land * (pb - bt)

    def supply_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B per supply pressure [m³/(s·Pa)]."""
        pa, _, pb, _ = (self._slope(d) for d in self.drops())
        return self._land * np.maximum(self.opening, 0.0) * pa, self._land * np.maximum(-self.opening, 0.0) * pb

    def tank_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B per return pressure [m³/(s·Pa)]."""
        _, at, _, bt = (self._slope(d) for d in self.drops())
        return self._land * np.maximum(-self.opening, 0.0) * at, self._land * np.maximum(self.opening, 0.0) * bt


def signals_of(
    plant: Plant, read: Mapping[str, Array], drive: Array, dt: float, formed: Residuals, to_velocity: VelocityFilter,
    velocity_noise: float, path: Path, windows: Mapping[str, int],
) -> Signals:  # fmt: skip
    """From channels as they were (sensor errors taken out), the balances formed of them and the model's path.

    ``windows``: see `smoothing_windows`.
    """
    n = formed.values.shape[1]
    x = read["position"]
    hydraulic = plant.model.kind == "hydraulic"
    none = np.zeros(n)

    def middle(values: Array) -> Array:
        return 0.5 * (values[1 : n + 1] + values[:n])

    smooth = smoothed(read, windows)

    def rate(name: str) -> Array:
        if name not in read:
            return none
        return middle(savgol_filter(read[name], windows[name], _CUBIC, deriv=1, delta=dt))

    velocity = middle(to_velocity(x))
    threshold = max(_MOVING * velocity_noise, 1e-9)
    made = formed.signals
    return Signals(
        plant=plant,
        hydraulic=hydraulic,
        dt=dt,
        time=dt * np.arange(n, dtype=np.float64),
        position=middle(smooth["position"]),
        velocity=velocity,
        direction=np.tanh(velocity / threshold),
        drive=np.clip(drive[:n] / plant.value("drive_limit"), -1.0, 1.0),
        opening=made["opening"],
        pressure_a=middle(smooth["pressure_a"]) if "pressure_a" in smooth else none,
        pressure_b=middle(smooth["pressure_b"]) if "pressure_b" in smooth else none,
        rate_a=rate("pressure_a"),
        rate_b=rate("pressure_b"),
        capacity_a=made.get("capacity_a", none),
        capacity_b=made.get("capacity_b", none),
        flow_a=made.get("flow_a", none),
        flow_b=made.get("flow_b", none),
        pressure_supply=made["pressure_supply"],
        path=path,
    )


def smoothing_windows(channels: Mapping[str, Array], noise: Mapping[str, float], dt: float) -> dict[str, int]:
    """Samples of the cubic that gives each channel's rate with the smallest expected error (see `VelocityFilter`)."""
    return {n: VelocityFilter.for_signal(v, dt, noise[n]).window for n, v in channels.items() if n != "drive"}


def smoothed(read: Mapping[str, Array], windows: Mapping[str, int]) -> dict[str, Array]:
    """Position and pressures (N,) through cubics of their windows."""
    return {n: savgol_filter(v, windows[n], _CUBIC) for n, v in read.items()}
