"""Fit a model's free parameters to records, and say how well these determine them.

Every record is cut into short pieces whose initial states are fitted along, so that the drift of an integrating
plant does not hide the rest. Writes calibrate.json, a page (report.html) and the calibrated model (model.yaml).
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import CalibrationError, Settings, calibrate
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, add_window_option, read_window, summary_json

MODEL = "model.yaml"
EPILOG = """\
examples:
  python -m hydraulic_sysid calibrate --model sample_bench --record examples/sample_bench --out runs/calibrated
  python -m hydraulic_sysid calibrate --model my.yaml --record a.csv b.csv --holdout-record c.csv --out runs/mine
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("calibrate", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("--model", metavar="FILE", required=True, help="model file, or the name of a preset")
    cli.add_record_options(parser)
    add_window_option(parser)
    parser.add_argument("--holdout-record", metavar="PATH", type=cli.Path, nargs="+", help="records the fit never sees")
    parser.add_argument(
        "--free", metavar="KEY", nargs="+", help="parameters to fit (default: those the model calls free)"
    )
    parser.add_argument("--piece", metavar="SECONDS", type=float, default=0.5, help="length of a piece (default 0.5)")
    parser.add_argument("--robust", action="store_true", help="let outliers count less (soft L1)")
    add_folder_options(parser)
    return cli.run(
        parser, _calibrate, argv, errors=(ModelError, SimulationError, CalibrationError, results.ResultError)
    )


def _calibrate(options: argparse.Namespace) -> int:
    results.check_target(options.out, "calibrate")
    if (options.out / MODEL).exists():
        raise CalibrationError(f"{options.out / MODEL} exists; choose another folder (a model is never overwritten)")
    model = load_model(options.model)
    records = read_window(options)
    held_out = read_all(options.holdout_record, options.columns) if options.holdout_record else []
    settings = Settings(length=options.piece, robust=options.robust)
    console = Console(stderr=True)
    with console.status("calibrating …") as status:
        done = calibrate(
            model, records, held_out, settings, options.free, lambda text: status.update(f"calibrating: {text} …")
        )
    results.write_result(options.out, done.result)
    save_model(done.model, options.out / MODEL)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(done.result, ()))
    else:
        _print(done.result, Console(file=sys.stdout, highlight=False))
        print(f"\n{options.out / MODEL}\n{page}")
    return cli.OK if done.result["converged"] else cli.NEGATIVE


def _print(result: dict[str, Any], console: Console) -> None:
    table = Table(title=f"{result['model']['name']}: calibrated (± standard error)", title_justify="left")
    table.add_column("parameter", no_wrap=True)
    table.add_column("before", justify="right", no_wrap=True)
    table.add_column("after", justify="left", no_wrap=True)
    for p in result["parameters"]:
        unit = "" if p["unit"] == "1" else f" {p['unit']}"
        note = ", at bound" if p["at_bound"] else ""
        after = f"{p['value']:.4g} ± {_error(p['standard_error'])}{unit}{note}"
        table.add_row(p["key"], f"{p['before']:.4g}", after)
    console.print(table)
    table = Table(title="residual over noise", title_justify="left")
    for title in ("record", "", "channel", "before", "after"):
        table.add_column(title, justify="right" if title in ("before", "after") else "left")
    for part, word in (("fit", "fit"), ("test", "test")):
        for row in (result[part] or {"records": []})["records"]:
            table.add_row(row["record"], word, row["channel"], f"{row['before']:.3g}", f"{row['after']:.3g}")
    console.print(table)
    for direction in result["not_identifiable"]:
        parts = ", ".join(f"{k} {w:+.2f}" for k, w in direction["weights"].items())
        console.print(f"the data cannot identify the combination {parts}")
    console.print(result["verdict"]["text"])


def _error(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) else "not identifiable"


if __name__ == "__main__":
    sys.exit(main())
