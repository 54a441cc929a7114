"""Where in a bag the experiments lie, from the events on the topic `experiment`."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydraulic_interfaces.contract import topic
from hydraulic_sysid.bag.reader import Bag
from hydraulic_sysid.bag.types import string_data

STARTED = "started"
ENDED = ("finished", "aborted")


@dataclass(frozen=True)
class Span:
    """Samples ``first`` … ``last`` − 1 of a bag; ``experiment`` is what was played there, None if unknown."""

    first: int
    last: int
    name: str = ""
    experiment: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def what(self) -> str:
        """For error texts."""
        return f"experiment {self.name or 'in the bag'}" if self.experiment else "the bag"


def spans(bag: Bag, stamps: NDArray[np.int64]) -> list[Span]:
    """One span per experiment that starts within the ``stamps`` (N,), or one over all if none does.

    An experiment without an end lasts until the next one or the end of the bag.
    """
    stream = bag.streams.get(topic("experiment"))
    events = [event for event in map(_event, stream.payloads if stream else ()) if event is not None]
    starts = [i for i, event in enumerate(events) if event.get("event") == STARTED]
    starts = [i for i in starts if stamps[0] <= int(events[i]["stamp_ns"]) <= stamps[-1]]
    if not starts:
        return [Span(0, int(stamps.size))]
    found = []
    for number, index in enumerate(starts):
        begin, following = events[index], events[index + 1 :]
        end = next((e for e in following if e.get("event") in (*ENDED, STARTED)), None)
        notes = []
        experiment = {**begin}
        until = int(stamps[-1]) + 1 if end is None else int(end["stamp_ns"])
        if end is None or end.get("event") == STARTED:
            notes.append("experiment: the bag does not hold its end")
        else:
            experiment.update(event=end["event"], reason=end.get("reason", ""), end_stamp_ns=until)
            if end["event"] != "finished":
                notes.append(f"experiment: {end['event']} ({end.get('reason') or 'no reason given'})")
        first, last = np.searchsorted(stamps, [int(begin["stamp_ns"]), until], side="left")
        name = f"{number + 1}" if len(starts) > 1 else ""
        found.append(Span(int(first), int(last), name, experiment, notes))
    return found


def _event(payload: bytes) -> dict[str, Any] | None:
    """The event in a message; None where it holds something else, which is none of the excitation's."""
    try:
        event = json.loads(string_data(payload))
    except Exception:  # anybody may publish anything there
        return None
    usable = isinstance(event, dict) and isinstance(event.get("stamp_ns"), int)
    return event if usable else None
