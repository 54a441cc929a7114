"""build [--all]: make the environment and build the packages whose sources changed (--all: every package)."""

from __future__ import annotations

from ..bench import Bench
from ..errors import UsageError

ORDER = 5


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up and build; says so when there was nothing to do."""
    if arguments and arguments[0] in ("-h", "--help"):
        print(f"usage: ./bench {__doc__}")
        return 0
    if set(arguments) - {"--all"}:
        raise UsageError(f"./bench build does not know {' '.join(arguments)}.", remedy="./bench build [--all]")
    built = bench.prepare(rebuild="--all" in arguments)
    print(f"{built} packages built." if built else "Nothing to build: environment and workspace are up to date.")
    return 0
