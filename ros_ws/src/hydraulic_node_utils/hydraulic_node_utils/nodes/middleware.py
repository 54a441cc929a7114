"""What the middleware is told by the environment before it is loaded: who may find a node, how soon it repeats."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Where Fast DDS looks for a profile: either name will do."""
_LOCAL = ("LOCALHOST", "OFF")

VARIABLES = {RANGE: "LOCALHOST", PROFILES[0]: str(Path(__file__).with_name("fastdds.xml"))}
_NETWORK = str(Path(__file__).with_name("fastdds_network.xml"))


def set_up() -> None:
    """Keep nodes on this machine, and repeat lost packets soon, unless the user's environment says otherwise.

    To be called before `rclpy.init`. A stranger on the network must not be able to move an actuator: a range of
    discovery alone leaves the sockets open to whoever knows the address, so the profile has them listen on the loopback
    interface. A user who sets a wider range wants a network, and gets the profile for it; one who sets a profile keeps
    it. Fast DDS asks its subscribers only every 3 s what they lack and have got, which a stream or a process that
    leaves would wait for; and a reader whose place in shared memory it has taken for broken would cost it all its time.
    """
    for name, value in variables(os.environ).items():
        os.environ.setdefault(name, value)


def variables(environ: Mapping[str, str]) -> dict[str, str]:
    """What has to be set beside what the user's environment says."""
    wanted = {name: value for name, value in VARIABLES.items() if name not in environ}
    if any(environ.get(name) for name in PROFILES):
        wanted.pop(PROFILES[0], None)
    elif environ.get(RANGE, "LOCALHOST") not in _LOCAL:
        wanted[PROFILES[0]] = _NETWORK
    return wanted


def reach(environ: Mapping[str, str], implementation: str) -> str:
    """Why others than this machine may reach a node of this environment and middleware; "" if they cannot."""
    if "fastrtps" not in implementation:
        return f"{implementation} is set up by its own files: see there whether it listens to the network"
    named = environ.get(PROFILES[1]) or environ.get(PROFILES[0], "")
    try:
        local = Path(named).read_bytes() == Path(VARIABLES[PROFILES[0]]).read_bytes()
    except OSError:
        local = False
    if local:
        return ""
    return f"others on the network may reach it ({RANGE}={environ.get(RANGE, '')}, profile {named or 'none'})"
