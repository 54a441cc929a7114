"""Python, the virtual environment and the room for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import distributions

from .. import environment_plan, virtualenv
from ..bench import Bench
from ..errors import BenchError
from ..findings import MISSING, NOTE, Finding

TITLE = "Python"
ORDER = 1

ENVIRONMENT_GB = 1.5  # of .venv; set-up needs some of it twice
SHOWN = ("numpy", "scipy", "numba", "control", "mcap", "python-can", "canopen")


def probe(bench: Bench) -> list[Finding]:
    """Interpreter, environment, packages, disk."""
    try:
        need = bench.needed_environment()
    except BenchError as error:
        return [Finding("interpreter", error.what, error.remedy, MISSING)]
    todo = environment_plan.current(bench.checkout, need)
    findings = [_interpreter(need), _environment(bench, need, todo)]
    if todo.action in ("keep", "install"):
        findings += [_packages(bench), _starts(bench)]
    return [*findings, _disk(bench, todo), *_caches(bench)]


def _interpreter(need: environment_plan.Stamp) -> Finding:
    probe_modules = [
        need.base,
        "-ES",
        "-c",
        "import venv, ensurepip, platform; print(platform.python_version())",
    ]
    answer = subprocess.run(probe_modules, capture_output=True, text=True, check=False)
    if answer.returncode:
        remedy = f"apt install python{need.python}-venv (Debian, Ubuntu), or name another one in BENCH_PYTHON"
        return Finding("interpreter", f"{need.base}, without venv and ensurepip", remedy, MISSING)
    return Finding("interpreter", f"{answer.stdout.strip()}, {need.base}")


def _environment(bench: Bench, need: environment_plan.Stamp, todo: environment_plan.Plan) -> Finding:
    if todo.action == "keep":
        return Finding("environment", f"{bench.checkout.venv}, with {need.ros}")
    reason = todo.reason or "not made yet"
    return Finding("environment", reason, "./bench build (every other verb does it as well)", NOTE)


def _packages(bench: Bench) -> Finding:
    folders = [str(p) for p in bench.checkout.venv.glob("lib/python3*/site-packages")]
    folders += sys.path if bench.ros.prefix else []
    versions: dict[str, str] = {}
    for found in distributions(path=folders):
        versions.setdefault((found.metadata["Name"] or "").lower(), found.version)
    shown = [f"{name} {versions[name]}" for name in SHOWN if name in versions]
    return Finding("packages", f"{len(versions)}: {', '.join(shown)} …")


def _starts(bench: Bench) -> Finding:
    command = [str(bench.checkout.python), "-c", virtualenv.IMPORTS]
    answer = subprocess.run(command, env=bench.variables(), capture_output=True, text=True, check=False)
    if answer.returncode == 0:
        return Finding("imports", "numpy, numba, scipy and rclpy start")
    last = (answer.stderr.strip().splitlines() or ["no message"])[-1]
    return Finding("imports", last, "rm -rf .venv, then ./bench build", MISSING)


def _disk(bench: Bench, todo: environment_plan.Plan) -> Finding:
    free = shutil.disk_usage(bench.checkout.root).free / 1e9
    if todo.action in ("keep", "install"):
        return Finding("disk", f"{free:.1f} GB free")
    enough = free > 1.5 * ENVIRONMENT_GB
    remedy = "" if enough else f"the environment takes {ENVIRONMENT_GB} GB, setting it up half as much again"
    return Finding("disk", f"{free:.1f} GB free", remedy, "ok" if enough else MISSING)


def _caches(bench: Bench) -> list[Finding]:
    """Where compiled kernels are kept between runs; without a place every start compiles anew."""
    home = bench.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    chosen = bench.environ.get("HYDRAULIC_SIM_CACHE") or os.path.join(home, "hydraulic_sim")
    place = chosen
    while not os.path.exists(place):
        place = os.path.dirname(place) or "/"
    if os.access(place, os.W_OK):
        state = "filled" if os.path.isdir(chosen) and os.listdir(chosen) else "empty: the first run compiles"
        return [Finding("numba cache", f"{chosen} ({state})")]
    return [Finding("numba cache", f"{chosen} cannot be written", "set HYDRAULIC_SIM_CACHE to a folder of yours", NOTE)]
