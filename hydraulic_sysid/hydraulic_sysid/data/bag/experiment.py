"""What the topic `experiment` says of the run that a bag holds."""

from __future__ import annotations

from hydraulic_interfaces.contract import ABORTED, FINISHED, STARTED
from hydraulic_sysid.data.bag.types import json_data, string_data

ENDED = (FINISHED, ABORTED)


class ExperimentLog:
    """Follows the events of excitation runs.

    The topic is latched: the first event heard may be the end of an earlier run. An end therefore counts only
    after a start has been heard.
    """

    def __init__(self) -> None:
        self._started = ""
        self._ended = ""
        self.outcome = ""
        self.end_ns = 0

    def take(self, data: bytes) -> None:
        """A serialised message of the topic; one that is not an event (JSON with "event") changes nothing."""
        content = json_data(data)
        event = content.get("event")
        if event == STARTED:
            self._started, self._ended, self.outcome = string_data(data), "", ""
        elif event in ENDED and self._started:
            self._ended, self.outcome = string_data(data), str(event)
            stamp = content.get("stamp_ns")
            self.end_ns = stamp if isinstance(stamp, int) else 0

    @property
    def ended(self) -> bool:
        """Whether the run that was heard to start has ended; `outcome` says how, `end_ns` when."""
        return bool(self._ended)

    def custom_data(self) -> dict[str, str]:
        """The events, JSON as published, for the metadata of the bag: `experiment` and `experiment_end`."""
        events = {"experiment": self._started, "experiment_end": self._ended}
        return {key: text for key, text in events.items() if text}
