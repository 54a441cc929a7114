"""Identify a linear ARX model from records and try it on held-out data.

Least squares at one sampling time; best fit in free run and one step ahead, mean squared error and final
prediction error, on data that the fit has not seen. Writes identify.json and a page to look at (report.html)
into a folder.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sysid import cli, identification, results
from hydraulic_sysid.display import SHOWN, number
from hydraulic_sysid.linear_models import OFFSETS, ArxOrder, IdentificationError
from hydraulic_sysid.records import read_all

from .compare import add_folder_options, add_window_option, read_window, summary_json

EPILOG = """\
examples:
  python -m hydraulic_sysid identify --record runs/bag --holdout 0.2 --out runs/bag-identified
  python -m hydraulic_sysid identify --record a.csv.gz --holdout-record b.csv.gz --order 3 3 1 --out runs/arx
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("identify", __doc__.partition("\n")[0], EPILOG)
    cli.add_record_options(parser)
    add_window_option(parser)
    parser.add_argument(
        "--order", metavar=("NA", "NB", "NK"), type=int, nargs=3, default=(3, 3, 1), help="ARX order (default 3 3 1)"
    )
    parser.add_argument(
        "--sampling-time", metavar="SECONDS", type=float, default=0.05, help="of the model (default 0.05)"
    )
    held = parser.add_mutually_exclusive_group()
    held.add_argument(
        "--holdout", metavar="PART", type=float, default=0.2, help="last part of every record to hold out (default 0.2)"
    )
    held.add_argument("--holdout-record", metavar="PATH", type=cli.Path, nargs="+", help="records to hold out instead")
    parser.add_argument(
        "--offsets", choices=OFFSETS, default="estimate", help="constant offsets (default: estimate them)"
    )
    parser.add_argument("--input", metavar="CHANNEL", default="drive", help="input channel (default drive)")
    parser.add_argument("--output", metavar="CHANNEL", default="position", help="output channel (default position)")
    add_folder_options(parser)
    return cli.run(parser, _identify, argv, errors=(IdentificationError, results.ResultError))


def _identify(options: argparse.Namespace) -> int:
    results.check_target(options.out, "identify")
    settings = identification.Settings(
        order=ArxOrder(*options.order),
        sampling_time=options.sampling_time,
        holdout=options.holdout,
        offsets=options.offsets,
        input=options.input,
        output=options.output,
    )
    records = read_window(options)
    held_out = read_all(options.holdout_record, options.columns) if options.holdout_record else None
    result = identification.identify(records, held_out, settings)
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
    own = result["settings"]["output"]["unit"]
    factor, unit = SHOWN.get(own, (1.0, own))
    table = Table()
    for title in ("record", "data", "samples", "best fit, free run", "best fit, one step", f"MSE, one step, {unit}²"):
        left = title in ("record", "data")
        table.add_column(title, justify="left" if left else "right", no_wrap=left)
    for part, word in (("validation", "held out"), ("estimation", "fitted")):
        for r in result[part]["records"]:
            table.add_row(
                r["name"], word, str(r["samples"]), _fit(r["best_fit_free_run"]), _fit(r["best_fit_one_step"]),
                number(r["mse_one_step"] * factor**2),
            )  # fmt: skip
        table.add_section()
    console.print(table)
    console.print(result["verdict"]["text"])
    console.print(
        f"final prediction error {number(result['validation']['fpe'] * factor**2)} {unit}² "
        "(what is expected on fresh data)"
    )
    poles = ", ".join(_pole(p) for p in result["model"]["poles"])
    console.print(f"poles {poles}")


def _fit(value: float) -> str:
    """A best fit in percent; a dash where an unstable model has none."""
    return "–" if math.isnan(value) else f"{value:.2f} %".replace("-", "−")


def _pole(pole: dict[str, Any]) -> str:
    return f"{pole['real']:.4f}" + (f"{pole['imaginary']:+.4f}i" if pole["imaginary"] else "")


if __name__ == "__main__":
    sys.exit(main())
