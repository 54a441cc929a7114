"""Frequency response of records with coherence, noise and nonlinear distortion apart.

Records of a periodic excitation give the best linear approximation: noise from the differences between periods,
distortion from the detection lines and from the differences between realisations. Others give Welch's estimate, with
the empirical transfer function beside it. Writes frequency_response.json and a page.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import number
from hydraulic_sysid.linear.frequency_response.document import METHODS, Settings, respond
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, add_window_option, read_window, summary_json

EPILOG = """\
examples:
  python -m hydraulic_sysid frequency_response --record examples/sample_bench/multisine.csv.gz --out runs/response
  python -m hydraulic_sysid frequency_response --record runs/four/bag_1 runs/four/bag_2 --out runs/nonlinear
  python -m hydraulic_sysid frequency_response --record mine.csv --period 10 --start 2 --out runs/periodic
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("frequency_response", __doc__.partition("\n")[0], EPILOG)
    cli.add_record_options(parser)
    add_window_option(parser)
    parser.add_argument("--method", choices=METHODS, default="auto", help="default: by what the records hold")
    parser.add_argument("--input", metavar="CHANNEL", default="drive", help="input channel (default drive)")
    parser.add_argument("--output", metavar="CHANNEL", default="position", help="output channel (default position)")
    parser.add_argument("--period", metavar="SECONDS", type=float, help="of the excitation, where no plan tells it")
    parser.add_argument("--start", metavar="SECONDS", type=float, default=0.0, help="where its periods begin")
    parser.add_argument("--segment", metavar="SECONDS", type=float, help="of Welch's method (default: an eighth)")
    parser.add_argument("--width", metavar="HZ", type=float, help="over which the empirical estimate is smoothed")
    add_folder_options(parser)
    return cli.run(parser, _respond, argv, errors=(results.ResultError,))


def _respond(options: argparse.Namespace) -> int:
    results.check_target(options.out, "frequency_response")
    settings = Settings(
        method=options.method,
        input=options.input,
        output=options.output,
        period=options.period,
        start=options.start,
        segment=options.segment,
        width=options.width,
    )
    result = respond(read_window(options), settings)
    results.write_result(options.out, result)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(result, ("lines", "odd_lines", "even_lines", "welch", "etfe")))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{page}")
    return cli.OK


def _print(result: dict[str, Any], console: Console) -> None:
    if result["levels_db"] is not None:
        table = Table(title="level of the output beside its linear part", title_justify="left")
        table.add_column("")
        table.add_column("dB", justify="right")
        for name, value in result["levels_db"].items():
            table.add_row(name.replace("_", " "), "below the noise" if value is None else number(value))
        console.print(table)
    console.print(result["verdict"]["text"])


if __name__ == "__main__":
    sys.exit(main())
