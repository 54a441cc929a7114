"""The variables a command of the bench runs with."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from .checkout import Checkout
from .ros import DISTRO, Ros

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
LOCAL = ("LOCALHOST", "OFF")
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
PROFILE_FOLDER = Path("ros_ws", "src", "hydraulic_node_utils", "hydraulic_node_utils", "nodes")


def command_variables(checkout: Checkout, ros: Ros, environ: Mapping[str, str]) -> dict[str, str]:
    """`environ` as after activating `.venv` and sourcing `ros_ws/install/setup.sh`.

    Discovery and sockets stay on this machine unless the user chose otherwise: a stranger on the network must not
    move an actuator.
    """
    result = dict(environ)
    result.pop("PYTHONHOME", None)
    result["VIRTUAL_ENV"] = str(checkout.venv)
    result["PATH"] = joined([checkout.venv / "bin"], environ.get("PATH", os.defpath))
    installed = [checkout.install / name for name in checkout.packages() if (checkout.install / name).is_dir()]
    underlay = [] if ros.prefix else [checkout.venv]
    result["AMENT_PREFIX_PATH"] = joined([*installed, *underlay], environ.get("AMENT_PREFIX_PATH", ""))
    versions = [folder.name for folder in checkout.venv.glob("lib/python3*")]  # one: that of its interpreter
    modules = [prefix / "lib" / version / "site-packages" for prefix in installed for version in versions]
    result["PYTHONPATH"] = joined(filter(Path.is_dir, modules), environ.get("PYTHONPATH", ""))
    result.setdefault(RANGE, "LOCALHOST")
    profile = checkout.root / PROFILE_FOLDER / ("fastdds.xml" if result[RANGE] in LOCAL else "fastdds_network.xml")
    if not any(environ.get(name) for name in PROFILES) and profile.is_file():
        result[PROFILES[0]] = str(profile)  # for tools as well; the nodes do the same by themselves
    result.setdefault("OPENBLAS_NUM_THREADS", "1")  # more threads only spin: matrices are small
    if not ros.prefix:
        result.update(wheel_variables(checkout.venv, environ))
    return {name: value for name, value in result.items() if value or name in environ}


def build_variables(checkout: Checkout, ros: Ros, environ: Mapping[str, str]) -> dict[str, str]:
    """`environ` for colcon: neither the packages to be built nor the wheels count as an underlay."""
    result = command_variables(checkout, ros, environ)
    for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH", "PYTHONPATH"):
        parts = [p for p in environ.get(name, "").split(os.pathsep) if p and checkout.root not in Path(p).parents]
        result[name] = os.pathsep.join(parts) if ros.prefix else ""
    return {name: value for name, value in result.items() if value}


def wheel_variables(venv: Path, environ: Mapping[str, str]) -> dict[str, str]:
    """What the ROS 2 wheels need from the loader, set ahead: without it every Python starts itself twice.

    The wheels bring one implementation of the middleware, so that one is named.
    """
    folders = [venv / "lib", *sorted(venv.glob("lib/python3*/site-packages/ros_*.libs"))]
    return {
        "LD_LIBRARY_PATH": joined(folders, environ.get("LD_LIBRARY_PATH", "")),
        "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1",
        "ROS_DISTRO": DISTRO,
        "ROS_VERSION": "2",
        "ROS_PYTHON_VERSION": "3",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }


def joined(first: Iterable[Path], rest: str) -> str:
    """A path list: `first`, then the folders of `rest`, each once."""
    parts = [*map(str, first), *rest.split(os.pathsep)]
    return os.pathsep.join(dict.fromkeys(part for part in parts if part))
