"""Say which balance of a (calibrated) model the measurement breaks, by how much, over what, and whose it is.

Forms the balances of force and flow from the measured signals, beside those of an exact model under the same noise,
and shares out what is missing among forces, leakage, oil, valve, supply and sensors. Writes locate.json and a page
(report.html) into a folder.
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
from hydraulic_sysid.data.display import first_upper, number, percent, quantity
from hydraulic_sysid.diagnosis.locate import LocateError, locate
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, add_window_option, read_window, summary_json

EPILOG = """\
examples:
  python -m hydraulic_sysid locate --model runs/calibrated/model.yaml --record examples/sample_bench --out runs/located
"""
_BULKY = ("error_maps", "spectrum", "lag", "cross_lag", "autocorrelation", "exact_autocorrelation", "cross_correlation")


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("locate", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("--model", metavar="FILE", required=True, help="model file (calibrated), or name of a preset")
    cli.add_record_options(parser)
    add_window_option(parser)
    add_folder_options(parser)
    return cli.run(parser, _locate, argv, errors=(ModelError, SimulationError, LocateError, results.ResultError))


def _locate(options: argparse.Namespace) -> int:
    results.check_target(options.out, "locate")
    model = load_model(options.model)
    records = read_window(options)
    console = Console(stderr=True)
    with console.status("locating …") as status:
        result = locate(model, records, lambda name: status.update(f"forming the balances of {name} …"))
        status.update("writing the report …")
        results.write_result(options.out, result)
        from hydraulic_sysid.report import write_page

        page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(result, _BULKY))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{page}")
    return cli.OK


def _print(result: dict[str, Any], console: Console) -> None:
    table = Table(title=f"{result['model']['name']}: balances", title_justify="left")
    for title in ("balance", "residual RMS", "noise", "ratio", "band"):
        table.add_column(title, justify="left" if title == "balance" else "right", no_wrap=True)
    for b in result["balances"]:
        table.add_row(
            first_upper(b["title"]),
            quantity(b["residual_rms"], b["unit"]),
            quantity(b["exact_rms"], b["unit"]),
            f"{number(b['ratio'])}×",
            f"below {number(b['band'][1])} Hz",
        )
    if result["balances"]:
        console.print(table)
    table = Table(title="what each subsystem explains of what is missing", title_justify="left")
    for title in ("subsystem", "share", "alone"):
        table.add_column(title, justify="left" if title == "subsystem" else "right")
    for s in result["attribution"]:
        table.add_row(s["name"], percent(s["share"]), percent(s["alone"]))
    if result["attribution"]:
        console.print(table)
    console.print(result["verdict"]["text"])
    for finding in result["findings"]:
        if finding["kind"] != "at_noise":
            console.print(f"- {finding['text']}")


if __name__ == "__main__":
    sys.exit(main())
