"""ROS 2, the built workspace, discovery and the middleware."""

from __future__ import annotations

import shutil
from pathlib import Path

from ..bench import Bench
from ..environment import PROFILES
from ..errors import BenchError
from ..executables import executables
from ..findings import NOTE, Finding
from ..ros import DISTRO

TITLE = "ROS 2"
ORDER = 2

SHARED_MEMORY_MB = 64  # Fast DDS puts its segments there; containers often have just that much


def probe(bench: Bench) -> list[Finding]:
    """ROS flavour and version, tools, workspace, discovery range, domain, shared memory."""
    return [_flavour(bench), _tools(bench), _workspace(bench), *_discovery(bench), _shared_memory()]


def _flavour(bench: Bench) -> Finding:
    if bench.ros.prefix:
        return Finding("ROS 2", f"Jazzy, sourced from {bench.ros.prefix}")
    stock = Path("/opt/ros", DISTRO, "setup.sh")
    if stock.exists():
        return Finding("ROS 2", f"{stock.parent} is there but not sourced: the wheels are used", f". {stock}", NOTE)
    wheels = sorted(bench.checkout.venv.glob("lib/python3*/site-packages/ros_jazzy_rclpy-*.dist-info"))
    version = wheels[0].name.split("-")[1].removesuffix(".dist") if wheels else "not installed yet"
    return Finding("ROS 2", f"Jazzy wheels in .venv (rclpy {version}); no ROS 2 is sourced")


def _tools(bench: Bench) -> Finding:
    if shutil.which("ros2", path=bench.environ.get("PATH")):
        return Finding("ros2 command", "found: ./bench run hands over to it")
    return Finding(
        "ros2 command",
        "not there: ./bench run does its work; no ros2 launch, ros2 topic, ros2 bag",
        "they come with ROS 2 Jazzy on Ubuntu 24.04: docs.ros.org/en/jazzy/Installation",
        NOTE,
    )


def _workspace(bench: Bench) -> Finding:
    sources = bench.checkout.packages()
    try:
        stale = bench.stale_packages()
    except BenchError:
        return Finding("workspace", "not looked at: there is no interpreter for it", state=NOTE)
    if stale:
        reasons = dict.fromkeys(stale.values())
        found = "; ".join(f"{', '.join(n for n in stale if stale[n] == reason)}: {reason}" for reason in reasons)
        if len(reasons) == 1 and len(stale) == len(sources):
            found = next(iter(reasons))
        return Finding("workspace", found, "./bench build (every other verb does it as well)", NOTE)
    files = executables([bench.checkout.install / name for name in sources])
    return Finding("workspace", f"{len(sources)} packages built, {sum(map(len, files.values()))} executables")


def _discovery(bench: Bench) -> list[Finding]:
    given = bench.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
    domain = bench.environ.get("ROS_DOMAIN_ID", "0")
    wide = given not in (None, "LOCALHOST", "OFF")
    remedy = (
        "others on the network can reach the actuator; unset ROS_AUTOMATIC_DISCOVERY_RANGE to stay local"
        if wide
        else ""
    )
    own = next((bench.environ[name] for name in PROFILES if bench.environ.get(name)), "")
    if own and not wide:
        remedy = f"sockets: as your Fast DDS profile {own} says; docs/safety.md, who may talk"
    wide = wide or bool(own)
    found = [Finding("discovery", f"range {given or 'LOCALHOST'}, domain {domain}", remedy, NOTE if wide else "ok")]
    chosen = bench.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    if not bench.ros.prefix and chosen != "rmw_fastrtps_cpp":
        found.append(Finding("middleware", f"{chosen} is not among the wheels: rmw_fastrtps_cpp is used", state=NOTE))
    else:
        found.append(Finding("middleware", chosen))
    return found


def _shared_memory() -> Finding:
    try:
        free = shutil.disk_usage("/dev/shm").free / 1e6
    except OSError:
        return Finding("shared memory", "no /dev/shm: nodes talk over UDP, more slowly", state=NOTE)
    little = free < SHARED_MEMORY_MB
    remedy = "in a container: --shm-size=512m" if little else ""
    return Finding("shared memory", f"/dev/shm, {free:.0f} MB free", remedy, NOTE if little else "ok")
