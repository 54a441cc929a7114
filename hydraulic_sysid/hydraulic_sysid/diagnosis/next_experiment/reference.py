"""Movements become a drive: played on one of the models, which moves the piston where a movement wants it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.linear import operating_point
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant, PlantState, Trajectory
from hydraulic_sysid.excitation.amplitude import Limits
from hydraulic_sysid.excitation.plan import Prediction

from .movements import Bench, Movement

MARGIN = 0.9  # of the way to a limit that a prediction may use
_WAY = 4.0  # rad/s, with which the piston is moved to a position
_EVERY = 10e-3  # s between two looks at the piston on its way
_RISE = 0.15  # s in which the drive on the way goes from nothing to all: the oil is not made to ring


@dataclass(frozen=True)
class Leader:
    """Leads a plant to a position: drive [V] per distance [m] and per speed [m/s]."""

    distance: float
    speed: float

    @classmethod
    def of(cls, model: Model) -> Leader:
        """For a valve-driven piston, which integrates, or a mass under a force proportional to the drive.

        :raises SimulationError: the model has no steady motion.
        """
        if model.kind == "mechanical":
            inertia = model.value("moving_mass") / model.value("drive_force")
            return cls(inertia * _WAY**2, 2.0 * inertia * _WAY)
        drive = 0.5 * model.value("drive_limit")
        return cls(_WAY * drive / operating_point(model, drive=drive).velocity, 0.0)


@dataclass(frozen=True)
class Played:
    """A drive (N,) [V], what the leading model does under it, and where each movement begins (samples)."""

    drive: Array
    trajectory: Trajectory
    begins: tuple[int, ...]


def play(plant: Plant, leader: Leader, movements: Sequence[Movement], bench: Bench) -> Played:
    """The drive of movements one after the other, from rest at the bench's centre.

    :raises SimulationError: the model cannot follow.
    """
    dt = 1.0 / bench.rate
    start = state = plant.initial_state(position=bench.centre)
    block = max(1, round(_EVERY * bench.rate))
    parts: list[Array] = []
    begins: list[int] = []
    played, last = 0, 0.0
    for movement in movements:
        begins.append(played)
        for phase in movement.phases(bench):
            drives = [phase.drive] if phase.drive is not None else [np.zeros(n) for n in _blocks(phase.samples, block)]
            for drive in drives:
                if phase.drive is None:
                    change = phase.most * drive.size * dt / _RISE
                    wanted = _towards(leader, state, phase.target, phase.most)
                    drive[:] = min(max(wanted, last - change), last + change)
                if drive.size:
                    state = plant.simulate(drive, dt, state).final
                    last = float(drive[-1])
                parts.append(drive)
                played += drive.size
    whole = np.concatenate(parts)
    return Played(whole, plant.simulate(whole, dt, start), tuple(begins))


def extremes(name: str, run: Trajectory) -> Prediction:
    """The extremes of a trajectory."""
    pressures = np.concatenate((run.pressure_a, run.pressure_b))
    return Prediction(
        model=name,
        drive_peak=float(np.abs(run.drive).max()),
        position_min=float(run.position.min()),
        position_max=float(run.position.max()),
        velocity_peak=float(np.abs(run.velocity).max()),
        pressure_min=float(pressures.min()),
        pressure_max=float(pressures.max()),
    )


def used(limits: Limits, seen: Prediction, rest: tuple[float, float], centre: float) -> dict[str, float]:
    """Which part of each limit is used; of the pressures, of the way from those of rest ``(p_A, p_B)`` [Pa]."""
    travel = max(seen.position_max - centre, centre - seen.position_min)
    parts = {
        "drive": seen.drive_peak / limits.drive,
        "travel": travel / limits.travel / MARGIN,
        "velocity": seen.velocity_peak / limits.velocity / MARGIN,
    }
    low, high = min(rest), max(rest)
    parts["cavitation"] = _way(low - seen.pressure_min, low - limits.pressure_min)
    parts["pressure"] = _way(seen.pressure_max - high, limits.pressure_max - high)
    return parts


def _way(gone: float, allowed: float) -> float:
    if allowed <= 0.0:  # beyond the limit at rest
        return float("inf")
    return max(gone, 0.0) / allowed / MARGIN


def _blocks(samples: int, block: int) -> list[int]:
    return [block] * (samples // block) + ([samples % block] if samples % block else [])


def _towards(leader: Leader, state: PlantState, target: float, most: float) -> float:
    position, velocity = float(state.states[0]), float(state.states[1])
    drive = leader.distance * (target - position) - leader.speed * velocity
    return min(max(drive, -most), most)
