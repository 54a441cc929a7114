"""workbench [OPTION …]: the bench in a browser: see, excite, compare, diagnose, add, and watch the error fall.

Options go to `ros2 run hydraulic_workbench workbench`; `./bench workbench --help` lists them.
"""

from __future__ import annotations

from ..bench import Bench
from . import run as run_verb

ORDER = 1


def run(bench: Bench, arguments: list[str]) -> int:
    """Same as `./bench run hydraulic_workbench workbench …`."""
    return run_verb.run(bench, ["hydraulic_workbench", "workbench", *arguments])
