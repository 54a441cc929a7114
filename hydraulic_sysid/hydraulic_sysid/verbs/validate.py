"""Try identified linear models on triangles, squares, sines and sawteeth, and on records.

The grid of shapes, amplitudes and frequencies is played to the nonlinear plant of a model file; every model runs free
beside it. Records are tried alike, one step ahead too. Writes the errors (validate.json) and a page to look at
(report.html) into a folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid.data.display import number, shown
from hydraulic_sysid.linear.models import read_linear_model
from hydraulic_sysid.linear.validation import SHAPES, Grid
from hydraulic_sysid.linear.validation.validate import Subject, validate
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid validate --linear-model runs/tf/linear_model.json runs/arx/linear_model.json \\
      --model moog_mcr_m_1002_bench --amplitudes 1 2 4 --frequencies 0.2 0.5 1 --out runs/validated
  python -m hydraulic_sysid validate --linear-model runs/tf/linear_model.json --record other.csv.gz --out runs/other
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("validate", __doc__, EPILOG)
    parser.add_argument(
        "--linear-model", metavar="FILE", type=Path, nargs="+", required=True, help="models that identify has written"
    )
    parser.add_argument(
        "--model", metavar="FILE", help="model file or preset of the nonlinear plant to play the grid to"
    )
    add_trust_option(parser)
    parser.add_argument("--shapes", nargs="+", choices=list(SHAPES), default=list(SHAPES), help="default: all")
    parser.add_argument(
        "--amplitudes", metavar="V", type=float, nargs="+", default=[1.0, 2.0, 4.0], help="default 1 2 4"
    )
    parser.add_argument(
        "--frequencies", metavar="HZ", type=float, nargs="+", default=[0.2, 0.5, 1.0], help="default 0.2 0.5 1"
    )
    opt.add_record_options(parser, required=False, window=False)
    return opt.run(parser, _validate, _show, argv)


def _validate(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    subjects = _subjects(options.linear_model)
    grid = Grid(tuple(options.amplitudes), tuple(options.frequencies), tuple(options.shapes))
    plant = Plant(load_model(options.model)) if options.model else None
    return opt.Done(validate(subjects, plant, grid, opt.read_records(options)))


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


def _show(result: dict[str, Any], console: Console) -> None:
    own = result["settings"]["output"]["unit"]
    factor, unit = shown(own)
    names = [m["name"] for m in result["models"]]
    table = tables.table(f"RMSE [{unit}] and best fit of the free run", ("|drive", *(f">{name}" for name in names)))
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
