"""run PKG EXE [ARG …]: run an executable of a package, as `ros2 run` does (and by it, where installed)."""

from __future__ import annotations

import shutil

from .. import ros
from ..bench import Bench
from ..errors import UsageError
from ..executables import executables, find

ORDER = 3


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up what is missing, then become the executable; the exit code is its own."""
    if arguments and arguments[0] in ("-h", "--help"):
        print("usage: ./bench run PKG EXE [ARG …]")
        print(__doc__)
        return 0
    bench.prepare()
    variables = bench.variables()
    prefixes = ros.prefixes(variables)
    if len(arguments) < 2:
        own = {
            name: sorted(files) for name, files in executables(prefixes).items() if name in bench.checkout.packages()
        }
        offered = "\n".join(f"{name}: {', '.join(files)}" for name, files in own.items() if files)
        raise UsageError("usage: ./bench run PKG EXE [ARG …]", remedy=offered)
    package, executable, *rest = arguments
    path = find(prefixes, package, executable)
    if shutil.which("ros2", path=variables["PATH"]):
        return bench.replace_process(["ros2", "run", package, executable, *rest], variables)
    return bench.replace_process([str(path), *rest], variables)
