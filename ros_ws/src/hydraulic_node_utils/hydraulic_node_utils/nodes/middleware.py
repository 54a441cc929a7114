"""What the middleware is told by the environment before it is loaded: who may find a node, how soon it repeats."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLES = {
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("fastdds.xml")),
}


def set_up() -> None:
    """Keep discovery on this machine, and repeat lost packets soon, unless the user's environment says otherwise.

    To be called before `rclpy.init`. A stranger on the network must not be able to move an actuator. Fast DDS asks its
    subscribers only every 3 s what they lack and have got, which a stream or a process that leaves would wait for.
    """
    for name, value in VARIABLES.items():
        os.environ.setdefault(name, value)
