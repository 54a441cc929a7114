"""The balances of a record: what the measured signals ask for, less what the model gives at the measured state.

    force     m·ẍ − (p_A·A_A − p_B·A_B) − F          flow A   C_A·ṗ_A + A_A·ẋ − q_A
    spool     s − s_model                            flow B   C_B·ṗ_B − A_B·ẋ − q_B
    supply    p_S − p_S,model

Unlike a free run they do not drift, and a fault stays in the balance that it acts on: force and flows come from the
model at *measured* position, velocity and pressures (the model is started anew from them every few samples), so that a
wrong valve cannot spoil the force balance. Merritt (1967), Hydraulic Control Systems, ch. 6, for the equations; the
approach is that of structured residuals (Gertler 1998, Fault Detection and Diagnosis in Engineering Systems).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.slots import SLOTS
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

from .sensors import SensorErrors

RESTART = 5  # samples that the model runs from each measured state

UNITS = {"force": "N", "flow_a": "m^3/s", "flow_b": "m^3/s", "spool": "1", "supply": "Pa"}
"""Balances in the order of tables, with their SI unit."""
NEEDS: dict[str, tuple[str, ...]] = {
    "force": ("pressure_a", "pressure_b"),
    "flow_a": ("pressure_a",),
    "flow_b": ("pressure_b",),
    "spool": ("spool",),
    "supply": ("pressure_supply",),
}
"""Channels that a balance of a hydraulic plant needs beside drive and position."""


class LocateError(HydraulicError, ValueError):
    """A record does not allow any balance (channel missing, too short); the message says what is needed."""


def formable(model: Model, channels: Mapping[str, object] | set[str]) -> tuple[str, ...]:
    """The balances that channels allow, in order. A mechanical plant has the force balance alone."""
    if model.kind == "mechanical":
        return ("force",)
    return tuple(name for name, needs in NEEDS.items() if all(n in channels for n in needs))


@dataclass(frozen=True)
class Residuals:
    """Balances of one record at the middle of every sampling interval.

    ``values`` (B, n): what the measurement asks for beyond the model, so that a missing force or flow appears with its
    own sign. ``signals``: the model's side at the same instants, (n,) each: opening, supply pressure, flows, capacity.
    """

    names: tuple[str, ...]
    values: Array
    signals: dict[str, Array]


class Balances:
    """Forms the balances of records for one model, and for the same model with other parameter values."""

    def __init__(self, model: Model, spool_measured: bool) -> None:
        # A measured spool takes the place of whatever the model says between drive and spool.
        led = model
        if spool_measured:
            for name in model.effects:
                if model.library[name].slot in ("command", "spool"):
                    led = led.without_effect(name)
        self.model, self.plant, self.led = model, Plant(model), Plant(led)
        self.spool_measured = spool_measured
        self.soft = any(SLOTS[model.library[n].slot].name == "compliance" for n in model.effects)

    def with_parameters(self, values: dict[str, float]) -> Balances:
        """The same for other parameter values [SI]."""
        other = object.__new__(Balances)
        other.__dict__.update(self.__dict__)
        other.plant = self.plant.with_parameters(values)
        known = set(self.led.model.keys())
        other.led = self.led.with_parameters({k: v for k, v in values.items() if k in known})
        return other

    def form(
        self, channels: Mapping[str, Array], dt: float, names: tuple[str, ...], to_velocity: VelocityFilter,
        errors: SensorErrors,
    ) -> Residuals:  # fmt: skip
        """Balances ``names`` of ``channels`` (N,) as measured; `SensorErrors` takes out what the model's sensors do."""
        read = errors.corrected(channels)
        x, u = read["position"], channels["drive"]
        none = np.full(x.shape, np.nan)
        pa, pb = read.get("pressure_a", none), read.get("pressure_b", none)
        plant = self.led
        drive = u
        if self.spool_measured:
            drive = np.clip(channels["spool"], -1.0, 1.0) * plant.value("drive_limit")
        run, n = self._run(plant, drive, dt, x, to_velocity(x), pa, pb)
        signals = {name: _middle(run[name]) for name in ("pressure_supply", "opening", "spool")}
        signals["opening"] = run["opening"][:, :-1].reshape(-1)  # held over the interval with the drive
        rows: dict[str, Array] = {}
        step = np.diff(x)[:n] / dt
        if "force" in names:
            rows["force"] = self._force(plant, run, x, pa, pb, dt, n)
        if plant.model.kind == "hydraulic":
            signals |= self._capacities(plant, x, pa, pb, drive, dt, n, to_velocity)
            moved = _rate(run["true_position"], dt)
            for side, p, area in (("a", pa, plant.value("piston_area_a")), ("b", pb, -plant.value("piston_area_b"))):
                capacity = signals[f"capacity_{side}"]
                signals[f"flow_{side}"] = capacity * _rate(run[f"true_pressure_{side}"], dt) + area * moved
                if f"flow_{side}" in names:
                    asked = capacity * np.diff(p)[:n] / dt + area * step
                    rows[f"flow_{side}"] = asked - signals[f"flow_{side}"]
        if "supply" in names or "spool" in names:
            own = self._own(u, dt, x, to_velocity, pa, pb, n)
            if "spool" in names:
                rows["spool"] = channels["spool"][:n] - own["spool"]
            if "supply" in names:
                measured = 0.5 * (channels["pressure_supply"][1 : n + 1] + channels["pressure_supply"][:n])
                rows["supply"] = measured - own["pressure_supply"]
                self._resupply(rows, signals, measured, pa, pb, n)
        return Residuals(names, np.stack([rows[name] for name in names]), signals)

    def _run(
        self, plant: Plant, drive: Array, dt: float, x: Array, v: Array, pa: Array, pb: Array
    ) -> tuple[dict[str, Array], int]:
        """The model from every fifth measured state on, and how many intervals that makes."""
        starts = np.arange(0, x.size - RESTART, RESTART)
        hydraulic = plant.model.kind == "hydraulic"
        seen = np.stack([x, v, pa if hydraulic else 0.0 * x, pb if hydraulic else 0.0 * x], axis=1)
        states, memories = plant.track(drive, dt, starts, seen)
        known = np.isfinite(seen[starts])
        states[:, :4] = np.where(known, seen[starts], states[:, :4])
        return plant.predict(drive, dt, starts, RESTART, states, memories), starts.size * RESTART

    def _force(self, plant: Plant, run: dict[str, Array], x: Array, pa: Array, pb: Array, dt: float, n: int) -> Array:
        mass = plant.value("moving_mass")
        wide = np.concatenate(([2.0 * x[0] - x[1]], x, [2.0 * x[-1] - x[-2]]))
        asked = ((wide[3:] - wide[2:-1] - wide[1:-2] + wide[:-3]) / (2.0 * dt * dt))[:n]
        gap = mass * (asked - _rate(run["velocity"], dt))
        if plant.model.kind == "hydraulic":
            # The model's own pressures moved on from the measured ones within the few samples: their part is exchanged.
            for p, area, name in (
                (pa, plant.value("piston_area_a"), "true_pressure_a"),
                (pb, -plant.value("piston_area_b"), "true_pressure_b"),
            ):
                gap += area * (_middle(run[name]) - 0.5 * (p[1 : n + 1] + p[:n]))
        return gap

    def _capacities(
        self, plant: Plant, x: Array, pa: Array, pb: Array, drive: Array, dt: float, n: int, to_velocity: VelocityFilter
    ) -> dict[str, Array]:
        """Oil capacity of each chamber [m³/Pa] at the middle of each interval."""
        beta, half = plant.value("bulk_modulus"), 0.5 * plant.value("stroke")
        middle = 0.5 * (x[1 : n + 1] + x[:n])
        least = 0.01 * min(plant.value("dead_volume_a"), plant.value("dead_volume_b"))
        found = {}
        for side, sign in (("a", 1.0), ("b", -1.0)):
            area = plant.value(f"piston_area_{side}")
            volume = np.maximum(plant.value(f"dead_volume_{side}") + area * (half + sign * middle), least)
            found[f"capacity_{side}"] = volume / beta
        if self.soft:
            found |= self._softened(plant, x, pa, pb, drive, dt, n, to_velocity)
        return found

    def _softened(
        self, plant: Plant, x: Array, pa: Array, pb: Array, drive: Array, dt: float, n: int, to_velocity: VelocityFilter
    ) -> dict[str, Array]:
        """Capacities of a model with compliance effects: by how much less a pressure rises for a faster piston."""
        v, nudge = to_velocity(x), 1e-3
        slow, _ = self._run(plant, drive, dt, x, v - nudge, pa, pb)
        fast, _ = self._run(plant, drive, dt, x, v + nudge, pa, pb)
        found = {}
        for side, sign in (("a", 1.0), ("b", -1.0)):
            p, area = f"true_pressure_{side}", plant.value(f"piston_area_{side}")
            moved = (fast["true_position"] - slow["true_position"])[:, 1]
            pressed = (slow[p] - fast[p])[:, 1]
            found[f"capacity_{side}"] = np.repeat(sign * area * moved / pressed, RESTART)
        return found

    def _own(
        self, drive: Array, dt: float, x: Array, to_velocity: VelocityFilter, pa: Array, pb: Array, n: int
    ) -> dict[str, Array]:
        """What the model itself says of spool (at the samples) and supply (between them)."""
        run, _ = self._run(self.plant, drive, dt, x, to_velocity(x), pa, pb)
        return {
            "spool": run["spool"][:, :-1].reshape(-1),
            "pressure_supply": _middle(run["pressure_supply"]),
        }

    def _resupply(
        self, rows: dict[str, Array], signals: dict[str, Array], measured: Array, pa: Array, pb: Array, n: int
    ) -> None:
        """Let the flows come from the measured supply pressure instead of the model's."""
        plant = self.plant
        gain = plant.value("valve_flow") / np.sqrt(plant.value("valve_drop"))
        small, leak = plant.value("orifice_transition"), plant.value("valve_leakage")
        for side, p, sign in (("a", pa, 1.0), ("b", pb, -1.0)):
            if f"flow_{side}" in rows:
                middle = 0.5 * (p[1 : n + 1] + p[:n])
                land = gain * (np.maximum(sign * signals["opening"], 0.0) + leak)
                change = root(measured - middle, small) - root(signals["pressure_supply"] - middle, small)
                rows[f"flow_{side}"] = rows[f"flow_{side}"] - land * change
        signals["pressure_supply"] = measured


def root(drop: Array, transition: float) -> Array:
    """√Δp with a finite slope at zero, as the model's orifices have it."""
    return drop / np.sqrt(np.abs(drop) + transition)


def _rate(run: Array, dt: float) -> Array:
    return np.diff(run, axis=1).reshape(-1) / dt


def _middle(run: Array) -> Array:
    return (0.5 * (run[:, 1:] + run[:, :-1])).reshape(-1)
