"""A plan played on a model with the very answers that it gives on the bench, faster than time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import STARTED
from hydraulic_sim import base
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation.answer import LOST, STRAYED, Answers, compiled_play, why
from hydraulic_sysid.excitation.plan import Plan, Prediction

_CHANNELS = ("position", "velocity", "pressure_a", "pressure_b", "pressure_supply", "spool", "force", "drive")


@dataclass(frozen=True)
class Sensors:
    """What stands between the plant and its record.

    White noise and resolution of the position, noise of each pressure [m, m, Pa].
    """

    position_noise: float = 0.0
    position_resolution: float = 0.0
    pressure_noise: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class SimulatedRun:
    """The record of a simulated run, and why it was broken off (empty if it was not).

    `extremes` are those of the plant itself, without the sensors' noise.
    """

    record: Record
    aborted: str
    extremes: Prediction


def simulate_plan(
    plan: Plan, plant: Plant, sensors: Sensors | None = None, position: float | None = None
) -> SimulatedRun:
    """Play `plan` on `plant`, which starts at rest at `position` [m] (by default at the plan's centre).

    As on the bench, a drive answers a state and acts from the next one on.

    :raises SimulationError: the model cannot follow.
    """
    sensors = sensors or Sensors()
    start = plant.initial_state(position=plan.centre if position is None else position)
    answers, limit = Answers.of(plan), plant.value("drive_limit")
    count, dt = plan.time.size, 1.0 / plan.rate
    draw = np.random.default_rng(sensors.seed)
    seen = sensors.position_noise * draw.standard_normal(count)
    plant.simulate([0.0], dt, start)  # refuses a rate that a memory cannot follow
    drive, out = np.empty(count), np.empty((count, len(base.OUTPUTS)))
    done, end = compiled_play()(
        *plant.embedded()[:-1], start.states.copy(), start.memory.copy(), answers, dt, limit, seen,
        sensors.position_resolution, out, drive,
    )  # fmt: skip
    if end == LOST:
        plant.simulate(drive[: done + 1], dt, start)  # says where and why
        raise SimulationError(f"{plant.model.name!r} cannot be followed beyond {done * dt:.6g} s")
    aborted = why(answers, float(seen[done - 1])) if end == STRAYED else ""
    columns = {name: out[:done, i].copy() for i, name in enumerate(base.OUTPUTS) if name in _CHANNELS}
    force = columns["pressure_a"] * plant.value("piston_area_a") - columns["pressure_b"] * plant.value("piston_area_b")
    columns |= {"force": force, "drive": drive[:done].copy()}
    true, columns["position"] = columns["position"], seen[:done].copy()
    pressures = np.concatenate((columns["pressure_a"], columns["pressure_b"]))
    extremes = Prediction(
        model=plant.model.name,
        drive_peak=float(np.abs(columns["drive"]).max()),
        position_min=float(true.min()),
        position_max=float(true.max()),
        velocity_peak=float(np.abs(columns["velocity"]).max()),
        pressure_min=float(pressures.min()),
        pressure_max=float(pressures.max()),
    )
    for name in ("pressure_a", "pressure_b", "pressure_supply"):
        columns[name] += sensors.pressure_noise * draw.standard_normal(done)
    columns["spool"] *= plant.value("spool_travel")
    description = {"experiment": {"event": STARTED, "plan": plan.as_mapping()}, "notes": ["simulated on a model"]}
    return SimulatedRun(Record.sampled(plan.name, dt, columns, description=description), aborted, extremes)
