"""What the virtual environment has to be, and what there is to do about the one that is there."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from .checkout import Checkout
from .errors import BenchError
from .ros import Ros

STAMP = "bench.json"
INSTALLING, CHECKING, READY = "installing", "checking", "ready"


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
        """The stamp in `venv`, None where there is none; an unreadable one: a set-up that was not finished."""
        try:
            return cls(**json.loads((venv / STAMP).read_text(encoding="utf-8")))
        except FileNotFoundError:
            return None
        except (OSError, ValueError, TypeError):
            return cls(root="", base="", python="", ros="", pins="", stage=INSTALLING)

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
        raise BenchError(f"{pyproject} has no table [dependency-groups].", remedy="git checkout pyproject.toml")
    content = (re.sub(r"#.*", "", line).strip() for line in table[1].splitlines())
    return hashlib.sha256("\n".join(line for line in content if line).encode()).hexdigest()


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
    elif found and Path(found.base).is_file() and needed in (None, found.python):
        base, version = found.base, found.python
    elif needed not in (None, version):
        base, version = _interpreter(ros), str(needed)
    return Stamp(str(checkout.root), base, version, ros.label, pins(checkout.pyproject))


def current(checkout: Checkout, need: Stamp) -> Plan:
    """`plan` for the environment in `checkout`."""
    exists = checkout.venv.is_dir() and any(checkout.venv.iterdir())
    return plan(Stamp.read(checkout.venv), need, exists=exists, starts=os.access(checkout.python, os.X_OK))


def _interpreter(ros: Ros) -> str:
    """Real path of the first Python on the PATH that fits `ros` and starts (a pyenv shim may not)."""
    assert ros.python is not None
    name = f"python{_dotted(ros.python)}"
    question = f"import os, sys; print(sys.version_info[:2] == {ros.python} and os.path.realpath(sys.executable))"
    for folder in (*os.get_exec_path(), "/usr/bin"):
        candidate = Path(folder, name)
        if os.access(candidate, os.X_OK):
            asked = subprocess.run([candidate, "-ES", "-c", question], capture_output=True, text=True, check=False)
            if asked.returncode == 0 and asked.stdout.strip() != "False":
                return asked.stdout.strip()
    raise BenchError(
        f"The ROS 2 in {ros.prefix} needs Python {_dotted(ros.python)}, which is not on the PATH.",
        remedy=f"apt install {name} {name}-venv\nor call ./bench from a terminal where ROS 2 is not sourced.",
    )


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(map(str, version))
