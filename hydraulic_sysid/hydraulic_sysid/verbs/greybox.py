"""Put a black box on top of a physical model, and say how much is left that the physics does not name.

The model's error a horizon ahead is fitted by linear and nonlinear functions of the drive and of what the model
predicts, chosen by cross-validation, and these are tried on test data. Writes the shares of noise, of what the
black box explains and of what nothing explains (greybox.json) and a page to look at (report.html) into a folder.
"""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console

from hydraulic_node_utils import cli, tables
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.display import first_upper, percent, quantity
from hydraulic_sysid.diagnosis.grey_box import grey_box
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid greybox --model sample_bench --record examples/sample_bench --out runs/grey
  python -m hydraulic_sysid greybox --model my.yaml --record a.csv b.csv --holdout-record c.csv --out runs/mine
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("greybox", __doc__, EPILOG)
    opt.add_model_option(parser)
    opt.add_record_options(parser)
    opt.add_part_options(parser, 0.4)
    parser.add_argument("--horizon", metavar="SECONDS", type=float, default=0.5, help="how far ahead (default 0.5)")
    return opt.run(parser, _grey_box, _show, argv, bulky=("traces",))


def _grey_box(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    model = load_model(options.model)
    records = opt.read_records(options)
    test_records = opt.read_kept_back(options.holdout_record, options)
    if not test_records:
        if not 0.0 < options.holdout < 1.0:
            raise cli.UsageError(f"--holdout is {options.holdout:g}: a part between 0 and 1 is allowed")
        parts = [record.split(1.0 - options.holdout) for record in records]
        records, test_records = [first for first, _ in parts], [last for _, last in parts]
    return opt.Done(grey_box(model, records, test_records, options.horizon, lambda name: say(f"comparing {name}")))


def _show(result: dict[str, Any], console: Console) -> None:
    title = f"What {result['model']['name']} leaves {result['settings']['horizon']:g} s ahead, test data"
    columns = ("channel", ">white box", ">+ linear", ">+ nonlinear", ">exact model", ">not named", ">neither")
    table = tables.table(title, columns)
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
