"""Bags: rosbag2 folders with one MCAP file, written while an experiment runs and made whole after a crash.

Serialised messages go in as they came; nothing here knows ROS. Reading a bag as a record is
`hydraulic_sysid.data.records`.
"""

from hydraulic_sysid.data.bag.experiment import ExperimentLog
from hydraulic_sysid.data.bag.metadata import BagTopic, offered_qos
from hydraulic_sysid.data.bag.recording import Recording
from hydraulic_sysid.data.bag.recovery import Recovery, recover
from hydraulic_sysid.data.bag.stop_rule import StopRule
from hydraulic_sysid.data.bag.types import message_type
from hydraulic_sysid.data.bag.writer import BagWriter

__all__ = [
    "BagTopic",
    "BagWriter",
    "ExperimentLog",
    "Recording",
    "Recovery",
    "StopRule",
    "message_type",
    "offered_qos",
    "recover",
]
