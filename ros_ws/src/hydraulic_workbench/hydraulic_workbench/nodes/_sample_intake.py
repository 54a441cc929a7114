"""The streams of the contract, emptied into a ring of samples some thirty times a second."""

from __future__ import annotations

import time

from rclpy.node import Node

from hydraulic_interfaces.contract import find_topic
from hydraulic_interfaces.conversions import interface_class
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes.mailbox import Mailbox
from hydraulic_sysid.data.bag.continuity import Continuity
from hydraulic_workbench.columns import COLUMNS, STATE, streams
from hydraulic_workbench.sample_ring import SampleRing
from hydraulic_workbench.stream_decoder import StreamDecoder

_DEPTH = 5000  # messages of a topic that wait while this process is held up: five seconds at 1 kHz
_FRESH_S = 0.5  # after its last message a topic is no longer waited for


class _Stream:
    """One topic: its subscription, its decoder, what has come and what is missing."""

    def __init__(self, node: Node, topic: str, columns: tuple[int, ...]) -> None:
        kind = find_topic(topic).type
        self.columns = columns
        self.box = Mailbox(node, interface_class(kind), topic, profile(topic, _DEPTH), raw=True)
        self.decode = StreamDecoder(kind, [COLUMNS[i] for i in columns])
        self.continuity = Continuity()
        self.heard = float("-inf")

    def take(self) -> list[bytes]:
        """Every waiting message."""
        payloads = []
        continuity = self.continuity
        continuity.publishers_are(self.box.publishers)
        for data, info in self.box.take_with_info():
            continuity.take(info["publication_sequence_number"] or 0)
            payloads.append(data)
        if payloads:
            self.heard = time.monotonic()
        return payloads


class SampleIntake:
    """Takes what has come on all streams into ``ring``; all calls but the properties' must come from one thread."""

    def __init__(self, node: Node, ring: SampleRing) -> None:
        self._ring = ring
        self._streams = {topic: _Stream(node, topic, columns) for topic, columns in streams().items()}
        self._state = self._streams[STATE]

    def drain(self) -> None:
        """The state last: what belongs to its newest rows has come by then or waits for them."""
        for stream in (*(s for s in self._streams.values() if s is not self._state), self._state):
            payloads = stream.take()
            if not payloads:
                continue
            put = self._ring.append if stream is self._state else self._ring.fill
            put(stream.columns, *stream.decode(payloads))

    def awaited(self) -> list[int]:
        """First columns of the topics that are coming now."""
        limit = time.monotonic() - _FRESH_S
        return [s.columns[0] for s in self._streams.values() if s is not self._state and s.heard > limit]

    @property
    def age(self) -> float:
        """Seconds since the last state came; infinite before the first."""
        return time.monotonic() - self._state.heard

    @property
    def missing(self) -> int:
        """Messages of all streams that did not come."""
        return sum(stream.continuity.missing for stream in self._streams.values())

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest state; 0 before the first."""
        return self._ring.newest_ns
