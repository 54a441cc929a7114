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

import copy
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sim.slots import SLOTS
from hydraulic_sysid.estimation.velocity_filter import VelocityFilter

from .sensor_errors import SensorErrors

RUN = 5  # samples that the model runs from each measured state

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
        behind_spool = model
        if spool_measured:
            for name in model.effects:
                if model.library[name].slot in ("command", "spool"):
                    behind_spool = behind_spool.without_effect(name)
        self.model, self.plant, self.flow_plant = model, Plant(model), Plant(behind_spool)
        self.spool_measured = spool_measured
        self.compliant = any(SLOTS[model.library[n].slot].name == "compliance" for n in model.effects)

    def with_parameters(self, values: dict[str, float]) -> Balances:
        """The same for other parameter values [SI]."""
        other = copy.copy(self)
        other.plant = self.plant.with_parameters(values)
        known = set(self.flow_plant.layout.parameters)
        other.flow_plant = self.flow_plant.with_parameters({k: v for k, v in values.items() if k in known})
        return other

    def form(
        self, channels: Mapping[str, Array], dt: float, names: tuple[str, ...], to_velocity: VelocityFilter,
        errors: SensorErrors,
    ) -> Residuals:  # fmt: skip
        """Balances ``names`` of ``channels`` (N,) as measured; `SensorErrors` takes out what the model's sensors do."""
        seen = states_seen(errors.corrected(channels), to_velocity)
        x, pa, pb = seen[:, 0], seen[:, 2], seen[:, 3]
        plant, drive = self.flow_plant, channels["drive"]
        if self.spool_measured:
            drive = np.clip(channels["spool"], -1.0, 1.0) * plant.value("drive_limit")
        run = _short_runs(plant, drive, dt, seen)
        n = run["spool"][:, 1:].size
        signals = {name: _middle(run[name]) for name in ("pressure_supply", "spool")}
        signals["opening"] = run["opening"][:, :-1].reshape(-1)  # held over the interval with the drive
        rows: dict[str, Array] = {}
        if "force" in names:
            rows["force"] = _force(plant, run, seen, dt, n)
        if plant.model.kind == "hydraulic":
            capacities = self._effective_capacities(drive, dt, seen) if self.compliant else _capacities(plant, x, n)
            for side, p, area in (("a", pa, plant.value("piston_area_a")), ("b", pb, -plant.value("piston_area_b"))):
                flow, signals[f"capacity_{side}"] = f"flow_{side}", capacities[side]
                rate, velocity = _rate(run[f"true_pressure_{side}"], dt), _rate(run["true_position"], dt)
                signals[flow] = capacities[side] * rate + area * velocity
                if flow in names:
                    required = capacities[side] * np.diff(p)[:n] / dt + area * np.diff(x)[:n] / dt
                    rows[flow] = required - signals[flow]
        if "supply" in names or "spool" in names:
            run = _short_runs(self.plant, channels["drive"], dt, seen)
            if "spool" in names:
                rows["spool"] = channels["spool"][:n] - run["spool"][:, :-1].reshape(-1)
            if "supply" in names:
                measured = between(channels["pressure_supply"], n)
                rows["supply"] = measured - _middle(run["pressure_supply"])
                self._use_measured_supply(rows, signals, measured, pa, pb, n)
        return Residuals(names, np.stack([rows[name] for name in names]), signals)

    def _effective_capacities(self, drive: Array, dt: float, seen: Array) -> dict[str, Array]:
        """Capacities of a model with compliance effects: by how much less a pressure rises for a faster piston."""
        nudge = np.array([0.0, 1e-3, 0.0, 0.0])
        slow, fast = (_short_runs(self.flow_plant, drive, dt, seen + change) for change in (-nudge, nudge))
        moved = (fast["true_position"] - slow["true_position"])[:, 1]
        found = {}
        for side, sign in (("a", 1.0), ("b", -1.0)):
            pressed = (slow[f"true_pressure_{side}"] - fast[f"true_pressure_{side}"])[:, 1]
            found[side] = np.repeat(sign * self.flow_plant.value(f"piston_area_{side}") * moved / pressed, RUN)
        return found

    def _use_measured_supply(
        self, rows: dict[str, Array], signals: dict[str, Array], measured: Array, pa: Array, pb: Array, n: int
    ) -> None:
        """Let the flows come from the measured supply pressure instead of the model's."""
        plant = self.plant
        gain = plant.value("valve_flow") / np.sqrt(plant.value("valve_drop"))
        small, leak = plant.value("orifice_transition"), plant.value("valve_leakage")
        for side, p, sign in (("a", pa, 1.0), ("b", pb, -1.0)):
            if f"flow_{side}" in rows:
                middle = between(p, n)
                land = gain * (np.maximum(sign * signals["opening"], 0.0) + leak)
                change = root(measured - middle, small) - root(signals["pressure_supply"] - middle, small)
                rows[f"flow_{side}"] = rows[f"flow_{side}"] - land * change
        signals["pressure_supply"] = measured


def states_seen(read: Mapping[str, Array], to_velocity: VelocityFilter) -> Array:
    """Position, velocity and both pressures ``(N, 4)`` of channels (N,); NaN where they were not measured."""
    x = read["position"]
    missing = np.full(x.shape, np.nan)
    return np.stack([x, to_velocity(x), read.get("pressure_a", missing), read.get("pressure_b", missing)], axis=1)


def runs_from(plant: Plant, drive: Array, dt: float, seen: Array, starts: Index, length: int) -> dict[str, Array]:
    """Runs of the model over ``length`` samples from the states ``seen`` at each start, the others propagated there."""
    states, memories = plant.track(drive, dt, starts, seen)
    states[:, :4] = np.where(np.isfinite(seen[starts]), seen[starts], states[:, :4])
    return plant.predict(drive, dt, starts, length, states, memories)


def root(drop: Array, transition: float) -> Array:
    """√Δp with a finite slope at zero, as the model's orifices have it."""
    return drop / np.sqrt(np.abs(drop) + transition)


def _short_runs(plant: Plant, drive: Array, dt: float, seen: Array) -> dict[str, Array]:
    """From every fifth measured state on."""
    return runs_from(plant, drive, dt, seen, np.arange(0, len(seen) - RUN, RUN), RUN)


def _force(plant: Plant, run: dict[str, Array], seen: Array, dt: float, n: int) -> Array:
    x = seen[:, 0]
    wide = np.concatenate(([2.0 * x[0] - x[1]], x, [2.0 * x[-1] - x[-2]]))
    required = ((wide[3:] - wide[2:-1] - wide[1:-2] + wide[:-3]) / (2.0 * dt * dt))[:n]
    gap = plant.mass * (required - _rate(run["velocity"], dt))
    if plant.model.kind == "hydraulic":
        # The model's own pressures moved on from the measured ones within the few samples: their part is exchanged.
        for index, area in ((2, plant.value("piston_area_a")), (3, -plant.value("piston_area_b"))):
            own = run["true_pressure_a" if index == 2 else "true_pressure_b"]
            gap += area * (_middle(own) - between(seen[:, index], n))
    return gap


def _capacities(plant: Plant, x: Array, n: int) -> dict[str, Array]:
    """Oil capacity of each chamber [m³/Pa] at the middle of each interval."""
    beta, half = plant.value("bulk_modulus"), 0.5 * plant.value("stroke")
    least = 0.01 * min(plant.value("dead_volume_a"), plant.value("dead_volume_b"))
    found = {}
    for side, sign in (("a", 1.0), ("b", -1.0)):
        swept = plant.value(f"piston_area_{side}") * (half + sign * between(x, n))
        found[side] = np.maximum(plant.value(f"dead_volume_{side}") + swept, least) / beta
    return found


def _rate(run: Array, dt: float) -> Array:
    return np.diff(run, axis=1).reshape(-1) / dt


def _middle(run: Array) -> Array:
    return (0.5 * (run[:, 1:] + run[:, :-1])).reshape(-1)


def between(values: Array, n: int) -> Array:
    """At the middle of the first ``n`` intervals between samples."""
    return 0.5 * (values[1 : n + 1] + values[:n])
