"""Who may find a node."""

from __future__ import annotations

import os


def stay_local() -> None:
    """Keep discovery on this machine unless the user's environment says otherwise; to be called before `rclpy.init`.

    A stranger on the network must not be able to move an actuator.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
