"""What regressors are made from: a record's signals, smoothed, and the model's own motion, between the samples.

Regressors made from measured derivatives carry the very noise that the balances carry: velocity, flow and pressure
rates together make up the balance itself, and a subsystem that has all three seems to explain its noise (errors in
variables; Fuller 1987, Measurement Error Models). The motion that the model makes in short runs from measured states
has nearly none of that noise, and is close enough to say what, for instance, a slow sensor would do to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from hydraulic_sim.arrays import Array
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

from .balances import Residuals, between, root, runs_from, states_seen

_CUBIC = 3
_MOVING = 3.0  # standard deviations of the velocity's noise at which a piston surely moves
_RUN_SECONDS = 0.25  # of the model's own motion
_PRESSURE_SECONDS = 0.025  # of the quadratic through which its initial pressures are read


@dataclass(frozen=True)
class ModelMotion:
    """``(n,)`` each: m/s, m/s², m/s³, and Pa/s for both chambers."""

    velocity: Array
    acceleration: Array
    jerk: Array
    rate_a: Array
    rate_b: Array


@dataclass(frozen=True)
class Signals:
    """Arrays ``(n,)`` in SI. ``hydraulic`` is False for a plant without oil, whose pressure signals are zero.

    ``rate_a`` … ``flow_b`` are rates of the pressures, oil capacities and flows of both chambers.
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
    motion: ModelMotion

    @property
    def load_pressure(self) -> Array:
        """p_A − p_B·A_B/A_A."""
        ratio = self.plant.value("piston_area_b") / self.plant.value("piston_area_a") if self.hydraulic else 1.0
        return self.pressure_a - self.pressure_b * ratio

    @property
    def _land(self) -> float:
        return self.plant.value("valve_flow") / np.sqrt(self.plant.value("valve_drop"))

    def drops(self) -> tuple[Array, Array, Array, Array]:
        """Over the lands: supply to A, A to return, supply to B, B to return [Pa]."""
        tank, supply = self.plant.value("tank_pressure"), self.pressure_supply
        return supply - self.pressure_a, self.pressure_a - tank, supply - self.pressure_b, self.pressure_b - tank

    def _roots(self) -> tuple[Array, ...]:
        return tuple(root(d, self.plant.value("orifice_transition")) for d in self.drops())

    def _slopes(self) -> tuple[Array, ...]:
        """Derivatives of the roots by their drops."""
        return tuple(0.5 / np.sqrt(np.abs(d) + self.plant.value("orifice_transition")) for d in self.drops())

    def opening_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B per opening [m³/s], on the side that is open."""
        pa, at, pb, bt = self._roots()
        out = self.opening >= 0.0
        return self._land * np.where(out, pa, at), -self._land * np.where(out, bt, pb)

    def centre_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B when both lands of a chamber open [m³/s per opening]."""
        pa, at, pb, bt = self._roots()
        return self._land * (pa - at), self._land * (pb - bt)

    def supply_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B per supply pressure [m³/(s·Pa)]."""
        pa, _, pb, _ = self._slopes()
        return self._land * np.maximum(self.opening, 0.0) * pa, self._land * np.maximum(-self.opening, 0.0) * pb

    def tank_gains(self) -> tuple[Array, Array]:
        """Flow into A and into B per return pressure [m³/(s·Pa)]."""
        _, at, _, bt = self._slopes()
        return self._land * np.maximum(-self.opening, 0.0) * at, self._land * np.maximum(self.opening, 0.0) * bt


def signals_of(
    plant: Plant, read: Mapping[str, Array], drive: Array, dt: float, formed: Residuals, to_velocity: VelocityFilter,
    velocity_noise: float, windows: Mapping[str, int],
) -> Signals:  # fmt: skip
    """From channels as they were (sensor errors taken out) and the balances formed of them.

    ``windows``: see `smoothing_windows`.
    """
    n = formed.values.shape[1]
    none = np.zeros(n)
    smooth = smoothed(read, windows)

    def rate(name: str) -> Array:
        if name not in read:
            return none
        return between(savgol_filter(read[name], windows[name], _CUBIC, deriv=1, delta=dt), n)

    seen = states_seen(read, to_velocity)
    velocity = between(seen[:, 1], n)
    return Signals(
        plant=plant,
        hydraulic=plant.model.kind == "hydraulic",
        dt=dt,
        time=dt * np.arange(n, dtype=np.float64),
        position=between(smooth["position"], n),
        velocity=velocity,
        direction=np.tanh(velocity / max(_MOVING * velocity_noise, 1e-9)),
        drive=np.clip(drive[:n] / plant.value("drive_limit"), -1.0, 1.0),
        rate_a=rate("pressure_a"),
        rate_b=rate("pressure_b"),
        motion=model_motion(plant, drive, dt, seen, n),
        **{name: between(smooth[name], n) if name in smooth else none for name in ("pressure_a", "pressure_b")},
        **{name: formed.signals.get(name, none) for name in ("capacity_a", "capacity_b", "flow_a", "flow_b")},
        **{name: formed.signals[name] for name in ("opening", "pressure_supply")},
    )


def model_motion(plant: Plant, drive: Array, dt: float, seen: Array, n: int) -> ModelMotion:
    """The first ``n`` values of runs of a quarter of a second from states as `states_seen` gives them (N, 4)."""
    size = len(seen)
    length = max(10, int(round(_RUN_SECONDS / dt)))
    last = size - 1 - length
    starts = np.unique(np.append(np.arange(0, last + 1, length), last)) if last > 0 else np.array([0])
    length = min(length, size - 1)
    width = min(max(5, 2 * int(round(0.5 * _PRESSURE_SECONDS / dt)) + 1), (size - 1) // 2 * 2 - 1)
    pressures = [p if np.isnan(p).any() else savgol_filter(p, width, 2) for p in seen[:, 2:].T]
    run = runs_from(plant, drive, dt, np.column_stack((seen[:, :2], *pressures)), starts, length)
    acceleration = np.gradient(run["velocity"], dt, axis=1)
    made = {
        "velocity": run["velocity"],
        "acceleration": acceleration,
        "jerk": np.gradient(acceleration, dt, axis=1),
        "rate_a": np.gradient(run["true_pressure_a"], dt, axis=1),
        "rate_b": np.gradient(run["true_pressure_b"], dt, axis=1),
    }
    index = starts[:, None] + np.arange(length)
    for name, values in made.items():
        whole = np.zeros(size - 1)
        whole[index] = 0.5 * (values[:, 1:] + values[:, :-1])
        made[name] = whole[:n]
    return ModelMotion(**made)


def smoothing_windows(channels: Mapping[str, Array], noise: Mapping[str, float], dt: float) -> dict[str, int]:
    """Samples of the cubic that gives each channel's rate with the smallest expected error (see `VelocityFilter`)."""
    return {n: VelocityFilter.for_signal(v, dt, noise[n]).window for n, v in channels.items() if n != "drive"}


def smoothed(read: Mapping[str, Array], windows: Mapping[str, int]) -> dict[str, Array]:
    """Position and pressures (N,) through cubics of their windows."""
    return {n: savgol_filter(v, windows[n], _CUBIC) for n, v in read.items()}
