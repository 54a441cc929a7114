"""Compare a model, or an FMU, with records: how far off it is, and where.

Runs the model beside every record in free run, a horizon ahead and one step ahead, and writes the figures
(compare.json) and a page to look at (report.html) into a folder.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_node_utils import cli, tables
from hydraulic_sim.exchange.foreign import KEYS, ForeignFmu
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.display import first_upper, number, quantity
from hydraulic_sysid.diagnosis.compare import ModelSubject, compare
from hydraulic_sysid.diagnosis.compare.findings import AT_FLOOR
from hydraulic_sysid.diagnosis.compare.fmu_subject import FmuSubject
from hydraulic_sysid.diagnosis.compare.reference_run import Compared
from hydraulic_sysid.diagnosis.compare.samples import write_samples
from hydraulic_sysid.diagnosis.compare.subject import Subject
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid compare --model sample_bench --record examples/sample_bench --out runs/first
  python -m hydraulic_sysid compare --model my.yaml --record runs/bag --horizon 1 --out runs/bag-compared
  python -m hydraulic_sysid compare --fmu axis.fmu --variables drive=u position=rod.s --record runs/bag --out runs/fmu
"""
SAMPLES = "samples.npz"
_LISTED = 3  # findings on the terminal; all of them stand in the results


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("compare", __doc__, EPILOG)
    what = parser.add_mutually_exclusive_group(required=True)
    opt.add_model_option(parser, within=what)
    what.add_argument(
        "--fmu", metavar="FILE", type=Path, help="an FMU of any tool (FMI 2.0, co-simulation), which is run"
    )
    parser.add_argument(
        "--variables",
        metavar="KEY=NAME",
        nargs="+",
        type=_pair,
        default=[],
        help=f"the FMU's own names, where they are others; keys: {', '.join(KEYS)}",
    )
    opt.add_record_options(parser)
    parser.add_argument("--horizon", metavar="SECONDS", type=float, default=0.5, help="how far ahead (default 0.5)")
    parser.add_argument("--samples", action="store_true", help=f"keep every sample behind the error maps ({SAMPLES})")
    return opt.run(parser, _compare, _show, argv, bulky=("traces", "drive", "error_maps", "spectra", "error_growth"))


def _compare(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    if options.variables and not options.fmu:
        raise cli.UsageError("--variables names variables of an FMU; there is no --fmu")
    subject: Subject
    if options.fmu:
        subject = FmuSubject(ForeignFmu(options.fmu, dict(options.variables)))
    else:
        subject = ModelSubject(load_model(options.model))
    records = opt.read_records(options)
    kept: list[Compared] = []
    keep = kept.extend if options.samples else None
    result = compare(subject, records, options.horizon, lambda name: say(f"comparing {name}"), keep)
    return opt.Done(result, {SAMPLES: partial(write_samples, kept)} if kept else {})


def _pair(text: str) -> tuple[str, str]:
    key, equals, name = text.partition("=")
    if not (key and equals and name):
        raise argparse.ArgumentTypeError(f"{text!r} is not KEY=NAME")
    return key, name


def _show(result: dict[str, Any], console: Console) -> None:
    console.print(error_table(result, _telling(result)))
    console.print(result["verdict"]["text"])
    for finding in [f for f in result["findings"] if f["kind"] in ("bias", "depends_on")][:_LISTED]:
        if finding["text"] not in result["verdict"]["text"]:
            console.print(f"• {finding['text']}")


def error_table(result: dict[str, Any], names: Sequence[str], overall: bool = True) -> Table:
    """Errors of those channels for every record, over all records (``overall``), and the noise beside them."""
    shown = {name: result["channels"][name] for name in names}
    summary = result["summary"]
    title = f"{result['model']['name']}: RMS error {result['settings']['horizon']:g} s ahead (× that of an exact model)"
    table = tables.table(title, ("|record", *(f">{first_upper(c['title'])}" for c in shown.values())))
    for record in result["records"]:
        cells = (_cell(record["channels"].get(name, {}).get("horizon"), c["unit"]) for name, c in shown.items())
        table.add_row(record["name"], *cells)
    table.add_section()
    if overall:
        table.add_row("all", *(_cell(summary[name]["horizon"], c["unit"]) for name, c in shown.items()), style="bold")
    table.add_row("noise", *(quantity(summary[name]["noise_std"], c["unit"]) for name, c in shown.items()))
    return table


def _telling(result: dict[str, Any]) -> list[str]:
    """Channels for a terminal's width: the load pressure stands for both chambers, what is always met is left out."""
    summary = result["summary"]
    hidden = {"pressure_a", "pressure_b"} if "load_pressure" in summary else set()
    hidden |= {n for n in ("pressure_supply", "spool") if n in summary and summary[n]["horizon"]["ratio"] <= AT_FLOOR}
    return [name for name in result["channels"] if name not in hidden]


def _cell(figures: dict[str, Any] | None, unit: str) -> str:
    """An error, and how many times that of an exact model it is."""
    if figures is None:
        return "–"
    times = f"{number(figures['rmse'] / figures['exact_rmse'])}×" if figures["exact_rmse"] else "–"
    return f"{quantity(figures['rmse'], unit)} ({times})"
