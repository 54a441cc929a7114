"""The virtual environment `.venv`: made once, repaired when half-made, updated when the pins change."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from .checkout import Checkout
from .environment import wheel_variables
from .errors import BenchError
from .ros import Ros
from .steps import run_step

STAMP = "bench.json"
PIP = "pip>=25.1"  # the first that reads dependency groups
INSTALLING, CHECKING, READY = "installing", "checking", "ready"
IMPORTS = "import numpy, numba, scipy, rclpy; rclpy.init(); rclpy.shutdown()"


@dataclass(frozen=True)
class Stamp:
    """What an environment was made of; kept in it, with the stage its making has reached."""

    root: str
    base: str
    python: str
    ros: str
    pins: str
    stage: str = READY

    @classmethod
    def read(cls, venv: Path) -> Stamp | None:
        """The stamp in `venv`, or None where there is none that can be read."""
        try:
            return cls(**json.loads((venv / STAMP).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None

    def write(self, venv: Path) -> None:
        """Replace the stamp in `venv` in one go."""
        new = venv / f"{STAMP}.new"
        new.write_text(json.dumps(asdict(self), indent=1), encoding="utf-8")
        new.replace(venv / STAMP)


@dataclass(frozen=True)
class Plan:
    """What to do: `keep`, `check`, `install` into it, `create` anew, `move` what is not ours away first."""

    action: str
    reason: str = ""


def pins(pyproject: Path) -> str:
    """Hash of the dependency groups in `pyproject` (other settings do not change an environment).

    The text is hashed, comments left out: Python 3.10 has no TOML reader, and pip reads the groups itself.
    """
    text = pyproject.read_text(encoding="utf-8")
    table = re.search(r"^\[dependency-groups\]\n(.*?)(?=^\[\w|\Z)", text, re.MULTILINE | re.DOTALL)
    if table is None:
        raise BenchError(
            f"{pyproject} has no table [dependency-groups].", remedy="git checkout pyproject.toml"
        )
    content = (re.sub(r"#.*", "", line).strip() for line in table[1].splitlines())
    return hashlib.sha256("\n".join(line for line in content if line).encode()).hexdigest()


def groups(ros: Ros) -> list[str]:
    """Dependency groups of pyproject.toml to install beside `ros`."""
    return ["library", "ros2-stock" if ros.prefix else "ros2-wheels", "tools"]


def plan(found: Stamp | None, wanted: Stamp, *, exists: bool, starts: bool) -> Plan:
    """What to do about an environment.

    :param found: its stamp
    :param exists: there is something at its place
    :param starts: there is an interpreter in it that can be executed
    """
    if not exists:
        return Plan("create")
    if found is None:
        return Plan("move", "the .venv here was not made by ./bench")
    if found.stage == INSTALLING:
        return Plan("create", "the last set-up was not finished")
    if not starts:
        return Plan("create", f"its Python ({found.base}) is gone")
    if found.root != wanted.root:
        return Plan("create", f"the checkout was moved from {found.root}")
    if (found.base, found.python) != (wanted.base, wanted.python):
        return Plan("create", f"Python is now {wanted.base}, was {found.base}")
    if found.ros != wanted.ros:
        return Plan("create", f"ROS 2 is now {wanted.ros}, was {found.ros}")
    if found.pins != wanted.pins:
        return Plan("install", "the pinned versions changed")
    return Plan("keep") if found.stage == READY else Plan("check", "it has not been seen to work yet")


def wanted(checkout: Checkout, ros: Ros, *, named: bool) -> Stamp:
    """The environment this call needs: of the Python in use already where that fits, else of the running one.

    :param named: the user named the running interpreter in BENCH_PYTHON
    :raises BenchError: the sourced ROS 2 needs a Python that is not there
    """
    found = Stamp.read(checkout.venv)
    base, version = os.path.realpath(sys.executable), _dotted(sys.version_info[:2])
    needed = _dotted(ros.python) if ros.python else None
    if named:
        if needed not in (None, version):
            raise BenchError(
                f"BENCH_PYTHON is Python {version}; the ROS 2 in {ros.prefix} needs {needed}.",
                remedy="unset BENCH_PYTHON, or call ./bench where ROS 2 is not sourced.",
            )
    elif found and Path(found.base).exists() and needed in (None, found.python):
        base, version = found.base, found.python
    elif needed not in (None, version):
        base, version = _interpreter(ros), str(needed)
    return Stamp(str(checkout.root), base, version, ros.label, pins(checkout.pyproject))


def current(checkout: Checkout, need: Stamp) -> Plan:
    """`plan` for the environment in `checkout`."""
    exists = checkout.venv.is_dir() and any(checkout.venv.iterdir())
    return plan(Stamp.read(checkout.venv), need, exists=exists, starts=os.access(checkout.python, os.X_OK))


def carry_out(
    todo: Plan, need: Stamp, checkout: Checkout, ros: Ros, environ: Mapping[str, str], lock: int
) -> None:
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


def _create(
    todo: Plan, need: Stamp, checkout: Checkout, ros: Ros, environ: Mapping[str, str], lock: int
) -> None:
    _require_venv(need)
    try:
        _clear(todo, checkout.venv)
        replace(need, stage=INSTALLING).write(checkout.venv)
    except OSError as error:
        raise BenchError(
            f"Cannot replace {checkout.venv}.",
            why=str(error),
            remedy="Correct its permissions, or delete it.",
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


def _clear(todo: Plan, venv: Path) -> None:
    """An empty folder at `venv`; what the user put there is moved aside, not deleted."""
    if todo.action == "move":
        aside = _free_name(venv)
        venv.rename(aside)
        print(f"It is now {aside}.", file=sys.stderr, flush=True)
    elif venv.is_symlink():
        venv.unlink()
    elif venv.exists():
        shutil.rmtree(venv)
    venv.mkdir()


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


def _interpreter(ros: Ros) -> str:
    assert ros.python is not None
    name = f"python{_dotted(ros.python)}"
    for candidate in (shutil.which(name), f"/usr/bin/{name}"):
        probe = ["-ES", "-c", f"import sys; sys.exit(sys.version_info[:2] != {ros.python})"]
        if candidate and os.access(candidate, os.X_OK) and not subprocess.call([candidate, *probe]):
            return os.path.realpath(candidate)
    raise BenchError(
        f"The ROS 2 in {ros.prefix} needs Python {_dotted(ros.python)}, which is not on the PATH.",
        remedy=f"apt install {name} {name}-venv\nor call ./bench from a terminal where ROS 2 is not sourced.",
    )


def _free_name(venv: Path) -> Path:
    number = 1
    while (aside := venv.with_name(f"{venv.name}.moved-{number}")).exists():
        number += 1
    return aside


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(map(str, version))
