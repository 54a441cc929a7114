"""doctor: say what is found, what is missing and how to get it: Python, ROS 2, CAN, clock.

Exit code 0 if the bench can run (or can be set up), 1 if not.
"""

from __future__ import annotations

import importlib
import pkgutil

from .. import probes
from ..bench import Bench
from ..errors import UsageError
from ..findings import MISSING, Finding

ORDER = 6


def run(bench: Bench, arguments: list[str]) -> int:
    """Print the findings of every file in `probes/`; changes nothing."""
    if arguments and arguments[0] in ("-h", "--help"):
        print(f"usage: ./bench {__doc__}")
        return 0
    if arguments:
        raise UsageError("./bench doctor takes no arguments.")
    names = [module.name for module in pkgutil.iter_modules(probes.__path__)]
    modules = [importlib.import_module(f"{probes.__name__}.{name}") for name in names]
    missing: list[Finding] = []
    for module in sorted(modules, key=lambda module: module.ORDER):
        print(module.TITLE)
        for finding in module.probe(bench):
            print("\n".join(finding.lines()), flush=True)
            missing += [finding] if finding.state == MISSING else []
    print()
    print(f"The bench cannot run: {', '.join(f.subject for f in missing)}." if missing else "The bench can run.")
    return 1 if missing else 0
