"""All checks of a model file against records, and their document (see docs/report-json.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.estimation.errors import CalibrationError
from hydraulic_sysid.estimation.segments import LONGEST, segment_length

from . import experiment, flows, forces, pressures, recording, travel
from .finding import CONTRADICTION, DOUBTFUL, NOT_IDENTIFIABLE, SEVERITIES, Finding, merged
from .identifiability import not_identifiable
from .observed import FEWEST_SAMPLES, Observed, Windows
from .senses import senses
from .stops import wrong_stops
from .units import wrong_units

_OF_CHANNELS = (
    recording.constant, recording.clipped, recording.frozen, recording.beyond_limit, recording.saturated,
    recording.reader_notes,
)  # fmt: skip
_OF_RECORDS = (pressures.beyond_supply, pressures.below_tank, pressures.below_vacuum, pressures.measured_supply)


def check(
    model: Model,
    records: Sequence[Record],
    length: float | None = None,
    keys: Sequence[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """The document: what the records contradict, what is doubtful, and what they cannot identify. Nothing is fitted.

    :param length: of the segments that are linearised [s] (default: as the plant asks for)
    :param keys: parameters that are to be identified (default: the model's free ones)
    :raises CalibrationError: no record, or one without drive or position.
    :raises hydraulic_sim.errors.ModelError: a model that does not compose.
    """
    length = length or segment_length(model, records)
    say = progress or (lambda _: None)
    say("the records against the model file")
    found = contradictions(model, records)
    if not any(f.kind == "unit" for f in found):  # a model linearised along other units says nothing
        say("what the records can identify")
        found = merged([*found, *not_identifiable(model, records, length, keys)])
    return {
        **heading("check"),
        "model": {"name": model.name, "path": None if model.path is None else str(model.path)},
        "settings": {"segment_length": length},
        "records": [
            {"name": r.name, "source": str(r.source), "samples": len(r), "sampling_time": r.dt, "duration": r.duration}
            for r in records
        ],
        "findings": rows(found),
        "verdict": verdict(found),
    }


def contradictions(model: Model, records: Sequence[Record]) -> list[Finding]:
    """All that needs neither fit nor linearisation, the worst first. Takes about a tenth of a second per record.

    :raises: as `check` does.
    """
    if not records:
        raise CalibrationError("there is no record to check the model against")
    for record in records:
        record.require("drive", "position", error=CalibrationError)
        if len(record) < FEWEST_SAMPLES:
            raise CalibrationError(f"{record.name}: {len(record)} samples; at least {FEWEST_SAMPLES} are needed")
    plant = Plant(model)
    frequency = experiment.resonance(model)
    every = [Observed.of(record, plant, frequency) for record in records]
    found = experiment.too_short(every) + experiment.little_drive(every) + experiment.slow_sampling(every)
    found += experiment.small_steps(every)
    found += [f for seen in every for one in _OF_CHANNELS for f in one(seen)]
    units = wrong_units(every)
    if units:  # what follows from a channel of the wrong size says nothing new
        return merged(found + units)
    travelled = travel.beyond_stroke(every) or wrong_stops(model, records, LONGEST)
    found += experiment.standing(every) + travelled
    signed = []
    for seen, signs in zip(every, senses(every), strict=True):
        found += [f for one in _OF_RECORDS for f in one(seen)] + signs
        signed += [] if any(f.severity == CONTRADICTION for f in signs) else [seen]
    return merged(found + _of_all(signed, plant))


def _of_all(records: Sequence[Observed], plant: Plant) -> list[Finding]:
    """What steady motion and accelerations of all records together say."""
    if not records:
        return []
    found = forces.mass(records)
    if plant.model.kind == "mechanical":
        return found
    every = Windows.joined([s.windows for s in records])
    steady = every.flowing
    measured = steady.subset(np.isfinite(steady.pressure_a + steady.pressure_b))
    found += forces.areas(measured, plant)
    # With areas in the wrong place neither supply nor flow means anything.
    if any(f.severity == CONTRADICTION for f in found):
        return found
    supply = pressures.steady_supply(measured, plant) or pressures.blocked_supply(every, plant)
    return found + supply + pressures.steady_ratio(measured, plant) + flows.valve_flow(steady, plant)


def rows(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """As a document has them."""
    return [{**asdict(f), "records": list(f.records)} for f in findings]


def verdict(findings: Sequence[Finding]) -> dict[str, str]:
    """How bad it is, and the contradictions in words."""
    count = {s: sum(f.severity == s for f in findings) for s in SEVERITIES}
    if count[CONTRADICTION]:
        text = "The records contradict the model file: " + " ".join(
            f.text for f in findings if f.severity == CONTRADICTION
        )
        return {"level": "off", "text": text}
    text = "Nothing in the records contradicts the model file"
    more = [f"{count[s]} {'is' if count[s] == 1 else 'are'} {s}" for s in (DOUBTFUL, NOT_IDENTIFIABLE) if count[s]]
    subjects = ", ".join(dict.fromkeys(f.subject for f in findings if f.severity in (DOUBTFUL, NOT_IDENTIFIABLE)))
    text += f"; {' and '.join(more)}: {subjects}." if more else "."
    return {"level": "close" if more else "explained", "text": text}


def warnings(findings: Sequence[Mapping[str, Any]]) -> list[str]:
    """The contradictions among a document's findings, each with what to do."""
    return [f"{f['text']} {f['remedy']}" for f in findings if f["severity"] == CONTRADICTION]
