"""Frequency response of records with coherence, noise and nonlinear distortion apart.

Records of a periodic excitation give the best linear approximation: noise from the differences between periods,
distortion from the detection lines and from the differences between realisations. Others give Welch's estimate, with
the empirical transfer function beside it. Writes frequency_response.json and a page.
"""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sysid.data.display import number
from hydraulic_sysid.linear.frequency_response.document import METHODS, respond
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid frequency_response --record examples/sample_bench/multisine.csv.gz --out runs/response
  python -m hydraulic_sysid frequency_response --record runs/four/bag_1 runs/four/bag_2 --out runs/nonlinear
  python -m hydraulic_sysid frequency_response --record mine.csv --period 10 --start 2 --out runs/periodic
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("frequency_response", __doc__, EPILOG)
    opt.add_record_options(parser)
    parser.add_argument("--method", choices=METHODS, default="auto", help="default: by what the records hold")
    opt.add_channel_options(parser)
    opt.add_period_options(parser)
    parser.add_argument("--segment", metavar="SECONDS", type=float, help="of Welch's method (default: an eighth)")
    parser.add_argument("--width", metavar="HZ", type=float, help="over which the empirical estimate is smoothed")
    return opt.run(parser, _respond, _show, argv, bulky=("lines", "odd_lines", "even_lines", "welch", "etfe"))


def _respond(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    names = ("method", "input", "output", "period", "start", "segment", "width")
    return opt.Done(respond(opt.read_records(options), **{name: getattr(options, name) for name in names}))


def _show(result: dict[str, Any], console: Console) -> None:
    if result["levels_db"] is not None:
        rows = [
            (name.replace("_", " "), "below the noise" if value is None else number(value))
            for name, value in result["levels_db"].items()
        ]
        console.print(tables.table("level of the output beside its linear part", ("", ">dB"), rows))
    console.print(result["verdict"]["text"])
