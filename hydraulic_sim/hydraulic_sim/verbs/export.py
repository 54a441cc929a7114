"""Export a model to other simulators: an FMU (FMI 2.0, co-simulation) or C.

Both run without Python. They go by samples of 1/rate, over which the drive is held, and compute what the simulated
actuator computes, bit by bit with the same C compiler's arithmetic.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from hydraulic_node_utils import cli
from hydraulic_node_utils.whole_file import write_text

from ..exchange.fmu import write_fmu
from ..exchange.plant_source import plant_source
from ..model_file import load_model

EPILOG = """\
examples:
  python -m hydraulic_sim export --model sample_bench --fmu actuator.fmu
  python -m hydraulic_sim export --model my.yaml --c actuator/ --rate 2000
"""
RATE = 1000.0


def main(argv: list[str] | None = None) -> int:
    """Write the file or folder. Exit code 0, or 2 for a model that C cannot be written of or a path that is taken."""
    parser = cli.parser("hydraulic_sim export", __doc__ or "", EPILOG)
    parser.add_argument("--model", required=True, metavar="FILE|NAME", help="a model file, or a preset's name")
    parser.add_argument("--rate", type=cli.positive, default=RATE, metavar="HZ", help=f"sampling ({RATE:g})")
    to = parser.add_mutually_exclusive_group(required=True)
    to.add_argument("--fmu", type=Path, metavar="FILE", help="the FMU to write")
    to.add_argument("--c", type=Path, metavar="FOLDER", help="the folder for plant.c and plant.h, made anew")
    return cli.run(parser, _export, argv)


def _export(options: argparse.Namespace) -> None:
    console = Console(highlight=False)
    model = load_model(options.model)
    target: Path = options.fmu or options.c
    if target.exists():
        raise cli.UsageError(f"{target} exists; choose another path (nothing is overwritten)")
    if options.fmu:
        made = write_fmu(model, target, options.rate)
        console.print(f"{target}: FMI 2.0 co-simulation, {options.rate:g} Hz, C sources and a binary for {made}"
                      if made else
                      f"{target}: FMI 2.0 co-simulation, {options.rate:g} Hz, C sources alone: no C compiler is here "
                      "(cc, gcc or clang); `fmpy compile` makes the binary where there is one")  # fmt: skip
        return
    for name, text in plant_source(model, options.rate).files.items():
        write_text(target / name, text, overwrite=False)
    console.print(f"{target}: plant.c, plant.h (C99, {options.rate:g} Hz)")


if __name__ == "__main__":
    sys.exit(main())
