"""demo [OPTION …]: excite, record, identify, compare and report on the simulated actuator, in one go.

Options go to `ros2 run hydraulic_bringup demo`; `./bench demo --help` lists them. With --workbench the result is then
opened in the workbench.
"""

from __future__ import annotations

import subprocess

from ..bench import Bench
from . import run as run_verb

ORDER = 1
DEMO = ["hydraulic_bringup", "demo"]
WORKBENCH = "--workbench"
LATEST = "runs/latest"


def run(bench: Bench, arguments: list[str]) -> int:
    """Same as `./bench run hydraulic_bringup demo …`, and then the workbench where it is asked for."""
    if WORKBENCH not in arguments:
        return run_verb.run(bench, [*DEMO, *arguments])
    own = [argument for argument in arguments if argument != WORKBENCH]
    bench.prepare()
    variables = bench.variables()
    code = subprocess.call(run_verb.command(bench, [*DEMO, *own], variables), env=variables)
    return code or run_verb.run(bench, ["hydraulic_workbench", "workbench", "--open", folder_of(own)])


def folder_of(arguments: list[str]) -> str:
    """Where a demo with these options has put its results."""
    for index, argument in enumerate(arguments):
        name, equals, value = argument.partition("=")
        if name == "--out":
            return value if equals else arguments[index + 1]
    return LATEST
