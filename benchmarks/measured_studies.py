"""Measured data of real machines: compare, diagnose, add, and the error on data that nothing has seen.

    ./bench shell -- python benchmarks/measured_studies.py SET [FOLDER] [--fetch] [--quick] [--machine NAME] [--out DIR]

Each SET is a module of `benchmarks/measured`. FOLDER holds the data as they are published (or the archive of them);
without it the excerpt that is shipped is studied, and --fetch clones the repository that publishes them. Prints the
verdict, its evidence and the rows of `docs/measured.md`; results, pictures and the reports of the verbs go into --out
(default runs/measured/SET). Exits with 1 if something that the page says does not hold, with 2 if there are no data.
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import sys
from pathlib import Path
from types import ModuleType

import measured
from hydraulic_interfaces.errors import HydraulicError
from measured.study import StudyError, Work, data_folder, fetched, where

SETS = [m.name for m in pkgutil.iter_modules(measured.__path__) if not m.name.startswith("_")]


def studies() -> dict[str, ModuleType]:
    """Every module of the package that is a study."""
    modules = {name: importlib.import_module(f"measured.{name}") for name in SETS}
    return {name: module for name, module in modules.items() if hasattr(module, "SOURCE")}


def main(argv: list[str] | None = None) -> int:
    every = studies()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", choices=tuple(every))
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--fetch", action="store_true", help="clone the repository that publishes the data")
    parser.add_argument("--quick", action="store_true", help="one machine of the set, without long searches, as in CI")
    parser.add_argument("--machine", help="of a set with several machines or joints this one alone")
    parser.add_argument("--out", type=Path, help="folder of the results, a new one")
    options = parser.parse_args(argv)
    study = every[options.set]
    out: Path = options.out or Path("runs/measured") / options.set
    try:
        out.mkdir(parents=True, exist_ok=True)
        work = Work(out, options.quick, options.machine)
        if options.folder is None and not options.fetch and study.EXCERPT is None:
            raise StudyError(f"{options.set}: no data are shipped; {where(study.SOURCE)}")
        given = fetched(study.SOURCE, out) if options.fetch else options.folder or study.EXCERPT
        if given == study.EXCERPT:
            print(f"{options.set}: the shipped excerpt alone; for all of it give a folder: {where(study.SOURCE)}")
        rows = study.study(data_folder(study.SOURCE, given, out / "data"), work)
        if not rows:
            raise StudyError(f"{options.set}: no machine {options.machine!r}; there are: {', '.join(work.machines)}")
    except HydraulicError as error:
        print(error, file=sys.stderr)
        return 2
    work.keep(rows)
    for row in rows:
        print(*row.lines(), sep="\n")
    print("seconds: " + ", ".join(f"{name} {value:.1f}" for name, value in work.seconds.items()))
    return 0 if all(row.good for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
