"""Makes the virtual environment `.venv`: creates it, installs the pinned packages, sees that they start."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from .checkout import Checkout
from .environment import wheel_variables
from .environment_plan import CHECKING, INSTALLING, Plan, Stamp
from .errors import BenchError
from .ros import Ros
from .steps import run_step

PIP = "pip>=25.1"  # the first that reads dependency groups
IMPORTS = "import numpy, numba, scipy, rclpy; rclpy.init(); rclpy.shutdown()"


def groups(ros: Ros) -> list[str]:
    """Dependency groups of pyproject.toml to install beside `ros`."""
    return ["library", "ros2-stock" if ros.prefix else "ros2-wheels", "tools"]


def carry_out(todo: Plan, need: Stamp, checkout: Checkout, ros: Ros, environ: Mapping[str, str], lock: int) -> None:
    """Do what `todo` says; call with the lock held.

    :raises BenchError: a step failed; the stamp then says from where to go on
    """
    if todo.reason:
        print(f"Python environment: {todo.reason}.", file=sys.stderr, flush=True)
    if todo.action in ("create", "move"):
        print("Setting up takes about a minute, more on a slow network.", file=sys.stderr, flush=True)
        _create(todo, need, checkout, ros, environ, lock)
    before = Stamp.read(checkout.venv)
    assert before is not None
    if todo.action != "check":
        replace(need, stage=INSTALLING).write(checkout.venv)
        try:
            _install(checkout, ros, environ, lock)
        except BenchError:
            before.write(checkout.venv)  # pip gives up before it changes anything: what was there still works
            raise
        replace(need, stage=CHECKING).write(checkout.venv)
    _check(checkout, ros, environ, lock)
    need.write(checkout.venv)


def _create(todo: Plan, need: Stamp, checkout: Checkout, ros: Ros, environ: Mapping[str, str], lock: int) -> None:
    _require_venv(need)
    try:
        if todo.action == "move" or checkout.venv.is_symlink():
            _move_aside(checkout.venv)
        elif checkout.venv.exists():  # the better part of a minute on a slow disk
            run_step(
                "Removing the old .venv",
                ["rm", "-rf", checkout.venv],
                log=checkout.logs / "remove.log",
                environ=environ,
                cwd=checkout.root,
                remedy=f"Delete {checkout.venv} yourself, then call ./bench again.",
                keep_open=[lock],
            )
        checkout.venv.mkdir()
        replace(need, stage=INSTALLING).write(checkout.venv)
    except OSError as error:
        raise BenchError(
            f"Cannot replace {checkout.venv}.", why=str(error), remedy="Correct its permissions, or delete it."
        ) from error
    visible = ["--system-site-packages"] if ros.prefix else []
    run_step(
        f"Creating .venv with Python {need.python} for {ros}",
        [need.base, "-m", "venv", *visible, checkout.venv],
        log=checkout.logs / "venv.log",
        environ=_clean(environ, ros),
        cwd=checkout.root,
        remedy="Check that there is room on the disk and that the folder can be written to.",
        keep_open=[lock],
    )


def _move_aside(venv: Path) -> None:
    """What the user put there is kept."""
    aside = _free_name(venv)
    venv.rename(aside)
    print(f"It is now {aside}.", file=sys.stderr, flush=True)


def _install(checkout: Checkout, ros: Ros, environ: Mapping[str, str], lock: int) -> None:
    pip = [str(checkout.python), "-m", "pip", "--disable-pip-version-check", "--no-input"]
    chosen = [f"--group={group}" for group in groups(ros)]
    for title, command in (
        ("Updating pip", [*pip, "install", "--progress-bar=off", PIP]),
        ("Installing the pinned packages", [*pip, "install", "--progress-bar=off", *chosen]),
    ):
        run_step(
            title,
            command,
            log=checkout.logs / f"{title.split()[0].lower()}.log",
            environ=_clean(environ, ros),
            cwd=checkout.root,
            remedy="Check the network, the proxy and the package index (PIP_INDEX_URL or pip.conf), "
            "then call ./bench again.",
            describe=_describe_pip,
            keep_open=[lock],
        )


def _check(checkout: Checkout, ros: Ros, environ: Mapping[str, str], lock: int) -> None:
    variables = {} if ros.prefix else wheel_variables(checkout.venv, environ)
    run_step(
        "Starting rclpy and numba once",
        [checkout.python, "-c", IMPORTS],
        log=checkout.logs / "check.log",
        environ={**_clean(environ, ros), **variables},
        cwd=checkout.root,
        remedy="Call ./bench doctor. If a package was damaged: rm -rf .venv, then call ./bench again.",
        keep_open=[lock],
    )


def _clean(environ: Mapping[str, str], ros: Ros) -> dict[str, str]:
    """Variables for venv and pip: packages of the caller's PYTHONPATH must not pass as installed."""
    dropped = {"PYTHONHOME", "VIRTUAL_ENV", "__PYVENV_LAUNCHER__", "PIP_TARGET", "PIP_PREFIX"}
    if not ros.prefix:
        dropped.add("PYTHONPATH")
    kept = {name: value for name, value in environ.items() if name not in dropped}
    return {**kept, "PIP_USER": "0", "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}


def _describe_pip(line: str) -> str | None:
    match = re.match(r"\s*(Collecting|Downloading|Using cached|Building wheel)s? (?:for )?(\S+)", line)
    if match:
        return f"{match[1].lower()} {match[2].rsplit('/', 1)[-1]}"
    match = re.match(r"Installing collected packages: (.*)", line)
    return f"unpacking {match[1].count(',') + 1} packages" if match else None


def _require_venv(need: Stamp) -> None:
    probe = [need.base, "-ES", "-c", "import venv, ensurepip"]
    if subprocess.run(probe, capture_output=True, check=False).returncode:
        raise BenchError(
            f"Python {need.python} ({need.base}) cannot make virtual environments.",
            why="its modules venv and ensurepip are missing",
            remedy=f"Debian, Ubuntu: apt install python{need.python}-venv\n"
            "or name another Python 3.10 to 3.13: BENCH_PYTHON=/path/to/python ./bench …",
        )


def _free_name(venv: Path) -> Path:
    number = 1
    while (aside := venv.with_name(f"{venv.name}.moved-{number}")).exists():
        number += 1
    return aside
