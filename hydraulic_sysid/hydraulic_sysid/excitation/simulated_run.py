"""A plan played on a model by the very code that plays it on the bench, faster than time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_interfaces.contract import STARTED
from hydraulic_sim.live import LivePlant
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation.plan import Plan, Prediction
from hydraulic_sysid.excitation.run import ExcitationRun, Phase

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
    run = ExcitationRun(plan)
    live = LivePlant(plant, plant.initial_state(position=plan.centre if position is None else position))
    count, dt = plan.time.size, 1.0 / plan.rate
    draw = np.random.default_rng(sensors.seed)
    noise = (sensors.position_noise * draw.standard_normal(count)).tolist()
    rows = np.empty((count, len(_CHANNELS)))
    drive, done = 0.0, count
    for index in range(count):
        now = live.step(drive, dt)
        rows[index] = now
        seen = now.position + noise[index]
        if sensors.position_resolution > 0.0:
            seen = round(seen / sensors.position_resolution) * sensors.position_resolution
        drive = run.step(index * dt, seen)
        rows[index, 0], noise[index] = seen, now.position
        if run.phase is Phase.ABORTED:
            done = index + 1
            break
    done = max(done, 2)
    columns = {name: rows[:done, i].copy() for i, name in enumerate(_CHANNELS)}
    true = np.array(noise[:done])
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
    return SimulatedRun(Record.sampled(plan.name, dt, columns, description=description), run.reason, extremes)
