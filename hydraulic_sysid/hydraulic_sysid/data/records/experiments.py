"""Where in a bag the experiments lie, from the events on the topic `experiment`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hydraulic_interfaces.contract import FINISHED, STARTED
from hydraulic_sim.arrays import Index
from hydraulic_sysid.data.bag.experiment import ENDED
from hydraulic_sysid.data.bag.reader import Bag
from hydraulic_sysid.data.bag.types import json_data
from hydraulic_sysid.data.errors import BagError


@dataclass(frozen=True)
class Span:
    """Samples ``first`` … ``last`` − 1 of a bag; ``experiment`` is what was played there, None if unknown."""

    first: int
    last: int
    name: str = ""
    experiment: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)


def spans(bag: Bag, stamps: Index) -> list[Span]:
    """One span per experiment that starts within the ``stamps`` (N,), or one over all if none does.

    An experiment without an end lasts until the next one or the end of the bag. One that ended before its second
    sample is left out, and noted in the others.

    :raises BagError: all of them did.
    """
    stream = bag.stream("experiment")
    said = map(json_data, stream.payloads if stream else ())
    events = [event for event in said if isinstance(event.get("stamp_ns"), int)]
    starts = [
        index
        for index, event in enumerate(events)
        if event.get("event") == STARTED and stamps[0] <= event["stamp_ns"] <= stamps[-1]
    ]
    if not starts:
        return [Span(0, int(stamps.size))]
    found = [_span(events[index], events[index + 1 :], stamps) for index in starts]
    usable = [span for span in found if span.last - span.first > 1]
    if len(usable) < len(found):
        note = f"experiment: {len(found) - len(usable)} more in the bag ended at once"
        usable = [replace(span, notes=[*span.notes, note]) for span in usable]
    if len(usable) > 1:
        usable = [replace(span, name=str(number)) for number, span in enumerate(usable, 1)]
    if not usable:
        raise BagError(bag.path, "every experiment in it ended before its second sample", expected="one to read")
    return usable


def _span(begin: dict[str, Any], following: Sequence[dict[str, Any]], stamps: Index) -> Span:
    """Samples of the experiment that ``begin`` starts, up to its own end or the next start."""
    run = begin.get("started_ns")
    end = next(
        (e for e in following if e.get("event") == STARTED or (e.get("event") in ENDED and e.get("started_ns") == run)),
        None,
    )
    notes, experiment = [], {**begin}
    until = int(stamps[-1]) + 1 if end is None else end["stamp_ns"]
    if end is None or end.get("event") == STARTED:
        notes.append("experiment: the bag does not hold its end")
    else:
        experiment.update({key: value for key, value in end.items() if key not in ("plan", "stamp_ns")})
        experiment["end_stamp_ns"] = until
        if end["event"] != FINISHED:
            notes.append(f"experiment: {end['event']} ({end.get('reason') or 'no reason given'})")
    first, last = np.searchsorted(stamps, [begin["stamp_ns"], until], side="left")
    return Span(int(first), int(last), "", experiment, notes)
