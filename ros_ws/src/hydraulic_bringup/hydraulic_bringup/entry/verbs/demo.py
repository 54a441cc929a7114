"""demo [OPTION …]: excite, record, identify, compare and report on the simulated actuator, in one go.

Options go to `ros2 run hydraulic_bringup demo`; `./bench demo --help` lists them.
"""

from __future__ import annotations

from ..bench import Bench
from . import run as run_verb

ORDER = 1


def run(bench: Bench, arguments: list[str]) -> int:
    """Same as `./bench run hydraulic_bringup demo …`."""
    return run_verb.run(bench, ["hydraulic_bringup", "demo", *arguments])
