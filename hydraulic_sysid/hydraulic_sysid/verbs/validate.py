"""Try identified linear models on triangles, squares, sines and sawteeth, and on records.

The grid of shapes, amplitudes and frequencies is played to the nonlinear plant of a model file; every model runs free
beside it. Records are tried alike, one step ahead too. Writes the errors (validate.json) and a page to look at
(report.html) into a folder.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import number, shown
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.linear.models import IdentificationError, read_linear_model
from hydraulic_sysid.linear.validation import SHAPES, Grid
from hydraulic_sysid.linear.validation.validate import Subject, validate
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, summary_json

EPILOG = """\
examples:
  python -m hydraulic_sysid validate --linear-model runs/tf/linear_model.json runs/arx/linear_model.json \\
      --model moog_mcr_m_1002_bench --amplitudes 1 2 4 --frequencies 0.2 0.5 1 --out runs/validated
  python -m hydraulic_sysid validate --linear-model runs/tf/linear_model.json --record other.csv.gz --out runs/other
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("validate", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument(
        "--linear-model", metavar="FILE", type=Path, nargs="+", required=True, help="models that identify has written"
    )
    parser.add_argument(
        "--model", metavar="FILE", help="model file or preset of the nonlinear plant to play the grid to"
    )
    parser.add_argument("--shapes", nargs="+", choices=list(SHAPES), default=list(SHAPES), help="default: all")
    parser.add_argument(
        "--amplitudes", metavar="V", type=float, nargs="+", default=[1.0, 2.0, 4.0], help="default 1 2 4"
    )
    parser.add_argument(
        "--frequencies", metavar="HZ", type=float, nargs="+", default=[0.2, 0.5, 1.0], help="default 0.2 0.5 1"
    )
    cli.add_record_options(parser, required=False)
    add_folder_options(parser)
    return cli.run(parser, _validate, argv, errors=(IdentificationError, results.ResultError))


def _validate(options: argparse.Namespace) -> int:
    results.check_target(options.out, "validate")
    subjects = _subjects(options.linear_model)
    try:
        grid = Grid(tuple(options.amplitudes), tuple(options.frequencies), tuple(options.shapes))
    except ValueError as error:
        raise cli.UsageError(str(error)) from None
    plant = Plant(load_model(options.model)) if options.model else None
    records = read_all(options.record, options.columns) if options.record else []
    result = validate(subjects, plant, grid, records)
    results.write_result(options.out, result)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(result, ()))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{page}")
    return cli.OK


def _subjects(paths: list[Path]) -> dict[str, Subject]:
    """The models by name; of equal names the file tells them apart."""
    found: dict[str, Subject] = {}
    for path in paths:
        model, content = read_linear_model(path)
        name = str(content.get("name", path.stem))
        ends = content.get("input", {}), content.get("output", {})
        channels = str(ends[0].get("channel", "drive")), str(ends[1].get("channel", "position"))
        key = name if name not in found else f"{name} ({path})"
        found[key] = Subject(model, str(path), *channels, unit=str(ends[1].get("unit", "m")))
    return found


def _print(result: dict[str, Any], console: Console) -> None:
    own = result["settings"]["output"]["unit"]
    factor, unit = shown(own)
    names = [m["name"] for m in result["models"]]
    table = Table(title=f"RMSE [{unit}] and best fit of the free run", title_justify="left")
    table.add_column("drive", no_wrap=True)
    for name in names:
        table.add_column(name, justify="right")
    for cell in result["grid"]:
        mark = "" if cell["within_travel"] else ", meets the stops"
        title = f"{cell['shape']} {cell['amplitude']:g} V {cell['frequency']:g} Hz{mark}"
        table.add_row(title, *(_error(cell["models"][n], factor) for n in names))
    table.add_section()
    for row in result["records"]:
        table.add_row(row["name"], *(_error(row["models"][n], factor) for n in names))
    console.print(table)
    console.print(result["verdict"]["text"])


def _error(figures: dict[str, Any], factor: float) -> str:
    if figures["rmse"] != figures["rmse"]:
        return "–"
    return f"{number(figures['rmse'] * factor)} ({figures['best_fit']:.1f} %)".replace("-", "−")


if __name__ == "__main__":
    sys.exit(main())
