"""Put a black box on top of a physical model, and say how much is left that the physics does not name.

The model's error a horizon ahead is fitted by linear and nonlinear functions of the drive and of what the model
predicts, chosen by cross-validation, and these are tried on data held out. Writes the shares of noise, of what the
black box explains and of what nothing explains (greybox.json) and a page to look at (report.html) into a folder.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import first_upper, percent, quantity
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.compare import ComparisonError
from hydraulic_sysid.diagnosis.grey_box import GreyBoxError, grey_box
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, add_window_option, read_window, summary_json

EPILOG = """\
examples:
  python -m hydraulic_sysid greybox --model sample_bench --record examples/sample_bench --out runs/grey
  python -m hydraulic_sysid greybox --model my.yaml --record a.csv b.csv --holdout-record c.csv --out runs/mine
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("greybox", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("--model", metavar="FILE", required=True, help="model file, or the name of a preset")
    cli.add_record_options(parser)
    add_window_option(parser)
    held = parser.add_mutually_exclusive_group()
    held.add_argument(
        "--holdout", metavar="PART", type=float, default=0.4, help="last part of every record to hold out (default 0.4)"
    )
    held.add_argument("--holdout-record", metavar="PATH", type=cli.Path, nargs="+", help="records to hold out instead")
    parser.add_argument("--horizon", metavar="SECONDS", type=float, default=0.5, help="how far ahead (default 0.5)")
    add_folder_options(parser)
    errors = (ModelError, SimulationError, ComparisonError, GreyBoxError, results.ResultError)
    return cli.run(parser, _grey_box, argv, errors=errors)


def _grey_box(options: argparse.Namespace) -> int:
    results.check_target(options.out, "greybox")
    model = load_model(options.model)
    records = read_window(options)
    if options.holdout_record:
        held_out = read_all(options.holdout_record, options.columns)
    elif not 0.0 < options.holdout < 1.0:
        raise cli.UsageError(f"--holdout is {options.holdout:g}: a part between 0 and 1 is allowed")
    else:
        parts = [record.split(1.0 - options.holdout) for record in records]
        records, held_out = [first for first, _ in parts], [last for _, last in parts]
    console = Console(stderr=True)
    with console.status("comparing …") as status:
        result = grey_box(model, records, held_out, options.horizon, lambda name: status.update(f"comparing {name} …"))
    results.write_result(options.out, result)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(result, ("traces",)))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{page}")
    return cli.OK


def _print(result: dict[str, Any], console: Console) -> None:
    title = f"What {result['model']['name']} leaves {result['settings']['horizon']:g} s ahead, held-out data"
    table = Table(title=title, title_justify="left")
    for head in ("channel", "white box", "+ linear", "+ nonlinear", "exact model", "not named", "neither"):
        table.add_column(head, justify="left" if head == "channel" else "right")
    for channel in result["channels"].values():
        side, part = channel["test"], channel["shares"]
        table.add_row(
            first_upper(channel["title"]),
            *(quantity(side[key], channel["unit"]) for key in ("white", "linear", "grey", "exact")),
            percent(part["linear"] + part["nonlinear"]),
            percent(part["unexplained"]),
        )
    console.print(table)
    console.print(result["verdict"]["text"])


if __name__ == "__main__":
    sys.exit(main())
