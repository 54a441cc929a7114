"""The recorder's ears: a subscription to every topic of the contract, emptied into a recording."""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from hydraulic_interfaces.contract import TOPICS, Topic
from hydraulic_interfaces.conversions import interface_class
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes.mailbox import Mailbox
from hydraulic_sysid.data.bag import BagTopic, ExperimentLog, Recording, message_type, offered_qos
from hydraulic_sysid.data.bag.continuity import Continuity
from hydraulic_sysid.data.bag.types import header_stamp

# Messages of a topic that wait while this process is held up: five seconds at 1 kHz.
_DEPTH = 5000
# How long commands are left alone while no state comes: without states they are no record.
_PLANT_S = 10.0


_LAST = "command"


class _Channel:
    """One topic: its subscription, its row in the bag, its gaps."""

    def __init__(self, node: Node, row: Topic) -> None:
        name, offered = node.resolve_topic_name(row.name), profile(row.qos)
        latched = offered.durability == DurabilityPolicy.TRANSIENT_LOCAL
        self.topic = BagTopic(name, message_type(row.type), (offered_qos(offered.depth, latched),))
        self.box = Mailbox(node, interface_class(row.type), row.name, profile(row.qos, _DEPTH), raw=True)
        self.continuity = Continuity()
        self.sampled = row.publisher == "plant" and row.qos == "stream"
        self.latest = b""


class Intake:
    """Takes what has come on all topics; all calls must come from one thread.

    Commands are subscribed to last, once the plant's states come: who waits for a listener to commands (the excitation
    does) then waits until the plant has been found too, and no first sample is lost.
    """

    def __init__(self, node: Node, recording: Recording) -> None:
        self._node, self._recording = node, recording
        self._channels = [_Channel(node, row) for row in TOPICS if row.name != _LAST]
        self._plant_due = time.monotonic() + _PLANT_S
        self._whole = False
        self._experiment_topic = node.resolve_topic_name("experiment")
        self.experiment = ExperimentLog()

    def drain(self) -> None:
        """Queue every waiting message for writing."""
        if not self._whole and (self.reached_ns() is not None or time.monotonic() > self._plant_due):
            self._whole = True
            self._channels += [_Channel(self._node, row) for row in TOPICS if row.name == _LAST]
        append = self._recording.append
        for channel in self._channels:
            bag_topic, continuity = channel.topic, channel.continuity
            continuity.publishers_are(channel.box.publishers)
            for data, info in channel.box.take_with_info():
                number = info["publication_sequence_number"] or 0
                received = info["received_timestamp"] or time.time_ns()
                append(bag_topic, data, received, info["source_timestamp"] or 0, number)
                continuity.take(number)
                channel.latest = data
                if bag_topic.name == self._experiment_topic:
                    self.experiment.take(data)

    def reached_ns(self) -> int | None:
        """Stamp up to which all streams of the plant have come that have come at all."""
        latest = [channel.latest for channel in self._channels if channel.sampled and channel.latest]
        return min(map(header_stamp, latest)) if latest else None

    def publishers(self) -> dict[str, int]:
        """Publishers that each topic is connected with, where there are any."""
        counts = {channel.topic.name: channel.box.publishers for channel in self._channels}
        return {name: count for name, count in counts.items() if count}

    def missing(self) -> dict[str, int]:
        """Messages that did not come, of the topics where some did not."""
        lost = {channel.topic.name: channel.continuity.missing for channel in self._channels}
        return {name: count for name, count in lost.items() if count}
