"""Stops where the piston rests, against those of the model.

A piston that rests at an end of its travel while the valve is open towards it, or that is told to go far beyond, stands
against a stop. Where the model has its stop elsewhere, the zero of the position, its scale or the stroke is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import quantity
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.saturation import at_end_of_range, runs
from hydraulic_sysid.estimation.segments import unjudged

from .finding import DOUBTFUL, Finding
from .travel import TOUCH, readings_at_stops

# Of full opening, beyond any overlap: a valve that drives the piston against what it rests at. Of the stroke: a command
# beyond where friction and a load hold a servo
OPEN = 0.05
HELD = 1.5  # times the friction of the model, which a piston without oil may rest under
SMOOTH = 25  # parts of a segment, over one of which a position is averaged
STILL = 0.2  # of what a stop gives way: what a piston at rest may seem to move
LONG = 0.5  # of a segment, that a rest lasts


@dataclass(frozen=True)
class OtherStop:
    """A stop ``at`` [m] that the model has at ``stated`` [m]; ``near``: per record where the piston is there (N,)."""

    at: float
    stated: float
    near: list[Mask]


def other_stops(model: Model, records: Sequence[Record], length: float) -> list[OtherStop]:
    """Ends of the travel that are stops, and not the model's; arriving there and leaving belong to them.

    An end at which the converter is at the end of its range says nothing.

    :param length: of a segment [s]
    """
    if "stroke" not in model.entries:
        return []
    plant = Plant(model)
    touch, opened = TOUCH * model.value("stroke"), _open(plant)
    smooth = [_smoothed(r, length) for r in records]
    judged = [x[unjudged(r) :] for x, r in zip(smooth, records, strict=True)]
    ends = min(float(x.min()) for x in judged), max(float(x.max()) for x in judged)
    found = []
    for side, stop, end in zip((-1.0, 1.0), readings_at_stops(plant, records[0].dt), ends, strict=True):
        near = [side * (x - end) > -2.0 * touch for x in smooth]
        rests = [
            (r, slice(a, b))
            for r, at in zip(records, near, strict=True)
            for a, b in runs(at & (side * _towards(plant, r) > opened))
            if (b - a) * r.dt >= LONG * length and _stands(r["position"][a:b], STILL * touch)
        ]
        clipped = any(at_end_of_range(r["position"])[where].any() for r, where in rests[:1])
        if rests and not clipped and abs(stop - end) > touch:
            level = float(np.median([np.median(r["position"][where]) for r, where in rests]))
            found.append(OtherStop(level, stop, near))
    return found


def wrong_stops(model: Model, records: Sequence[Record], length: float) -> list[Finding]:
    """As findings."""
    found = []
    for one in other_stops(model, records, length):
        text = (
            f"The piston rests at {quantity(one.at, 'm', 4)} with the valve open towards it; the model's stop is at "
            f"{quantity(one.stated, 'm', 4)}."
        )
        remedy = "Position 0 must be mid stroke: shift it (column map: offset), or correct its scale or stroke."
        names = tuple(r.name for r, at in zip(records, one.near, strict=True) if at.any())
        found.append(Finding("stop", "position", DOUBTFUL, text, remedy, one.at, one.stated, "m", names))
    return found


def _towards(plant: Plant, record: Record) -> Array:
    """What drives the piston (N,) [V]; where it follows a commanded position, by how far that lies ahead [m].

    Friction and loads hold such a piston short of where it is told to be: at rest it need not stand against anything.
    """
    return np.asarray(record["drive"] - record["position"]) if plant.closes_a_loop else record["drive"]


def _open(plant: Plant) -> float:
    """What moves a piston (`_towards`), unless a stop holds it: one without oil rests under less than its friction."""
    if plant.closes_a_loop:
        return OPEN * plant.value("stroke")
    opened = OPEN * plant.value("drive_limit")
    force = abs(plant.value("drive_force")) if plant.model.kind == "mechanical" else 0.0
    if not force:
        return opened
    state, stick = np.zeros((2, len(plant.layout.states))), plant.layout.states["stick"]
    state[:, stick] = -1.0, 1.0
    held = [plant.derivative(one, 0.0)[1]["force"] for one in state]
    return max(opened, HELD * abs(held[0] - held[1]) / 2.0 / force)


def _stands(position: Array, least: float) -> bool:
    """Whether the thirds of a stretch (n,) have the same median, to within ``least`` [m]."""
    medians = [float(np.median(part)) for part in np.array_split(position, 3)]
    return max(medians) - min(medians) <= least


def _smoothed(record: Record, length: float) -> Array:
    """The position (N,), averaged over a part of a segment."""
    size = max(1, round(length / SMOOTH / record.dt))
    return np.asarray(uniform_filter1d(record["position"], size, mode="nearest"))
