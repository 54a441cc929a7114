"""Publishes numbered samples on the five streams: `recorder_source.py SAMPLES PERIOD_S`; 0 samples: without end.

Waits for subscribers, announces an experiment, and stays until it is killed, so that nothing is lost with it.
"""

import json
import sys
import time

import rclpy
from std_msgs.msg import String

from hydraulic_interfaces.contract import find_topic, topic
from hydraulic_interfaces.conversions import CommandEncoder, PressureEncoder, StateEncoder, interface_class
from hydraulic_interfaces.qos import STREAM_HISTORY, profile
from hydraulic_interfaces.samples import PlantSample

STREAMS = ("state", "pressure_a", "pressure_b", "pressure_supply", "command")
count, period = int(sys.argv[1]), float(sys.argv[2])
rclpy.init()
node = rclpy.create_node("source", namespace="/test")
streams = [
    node.create_publisher(interface_class(find_topic(name).type), topic(name), profile(name, STREAM_HISTORY))
    for name in STREAMS
]
events = node.create_publisher(String, topic("experiment"), profile("experiment", 10))
while min(publisher.get_subscription_count() for publisher in (*streams, events)) < 1:
    time.sleep(0.02)


def announce(event: str, stamp_ns: int) -> None:
    events.publish(String(data=json.dumps({"event": event, "stamp_ns": stamp_ns, "plan": {"é": [1, 2]}})))


state, pressure, command = StateEncoder(), PressureEncoder(), CommandEncoder("source")
number, stamp = 0, 10**18
announce("started", stamp)
while number < count or not count:
    stamp, value = 10**18 + number * 10**6, float(number)
    streams[0].publish(state(PlantSample(stamp, value, 0.0, 0.0, 0.0)))
    for offset, publisher in enumerate(streams[1:4]):
        publisher.publish(pressure(stamp, value + offset))
    streams[4].publish(command(stamp, value))
    number += 1
    time.sleep(period)
announce("finished", stamp)
print("sent", flush=True)
time.sleep(600)
