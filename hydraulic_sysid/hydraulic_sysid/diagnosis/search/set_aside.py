"""What of a record is not judged: converters at their end, rests against a stop, runs apart, accidents.

A channel at its end does not show what it measures. A piston that stands against a stop while the valve is open says
where the stop is and nothing of the physics between the stops; where the model has its stop elsewhere (or position 0 is
not mid stroke), that would look like a missing effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Mask
from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.records.paired import APART
from hydraulic_sysid.diagnosis.check import other_stops
from hydraulic_sysid.estimation.saturation import at_end_of_range
from hydraulic_sysid.estimation.segments import MEASURED, Segments

SATURATED, STOP, FAR_OFF, DIFFERENT = "saturated", "stop", "far off", "runs apart"


@dataclass(frozen=True)
class SetAside:
    """A part of a record that is not judged: ``seconds`` in all, from ``time`` on, and what the channel reads there."""

    record: str
    channel: str
    reason: str
    seconds: float
    share: float
    time: float
    reading: float


def set_aside(model: Model, records: Sequence[Record], length: float) -> tuple[list[Mask], list[SetAside]]:
    """Per record the samples (N,) that are not judged; and what they are.

    :param length: of a segment [s]
    """
    masks, found = list[Mask](), list[SetAside]()
    stops = other_stops(model, records, length)
    for i, record in enumerate(records):
        out: Mask = np.zeros(len(record), dtype=bool)
        for channel in MEASURED:
            if channel in record and (model.kind == "hydraulic" or channel == "position"):
                at = at_end_of_range(record[channel])
                found += _noted(record, channel, SATURATED, at)
                out |= at
        for stop in stops:
            found += _noted(record, "position", STOP, stop.near[i] & ~out)
            out |= stop.near[i]
        if APART in record:
            apart = np.asarray(record[APART] > 0.0)
            found += _noted(record, "position", DIFFERENT, apart & ~out)
            out |= apart
        masks.append(out)
    return masks, found


def accidents(segments: Segments, far: Mask) -> list[SetAside]:
    """The segments that are ``far`` (S,) off all others."""
    out: Mask = np.zeros(len(segments.record), dtype=bool)
    for first in segments.first[far].tolist():
        out[first : first + segments.samples] = True
    return _noted(segments.record, "position", FAR_OFF, out)


def _noted(record: Record, channel: str, reason: str, at: Mask) -> list[SetAside]:
    if not at.any():
        return []
    begin, reading = float(record.time[int(np.argmax(at))]), float(np.median(record[channel][at]))
    return [SetAside(record.name, channel, reason, float(at.sum() * record.dt), float(at.mean()), begin, reading)]
