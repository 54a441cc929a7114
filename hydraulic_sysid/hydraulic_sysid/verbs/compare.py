"""Compare a model with records: how far off it is, and where.

Runs the model beside every record in free run, a horizon ahead and one step ahead, and writes the figures
(compare.json) and a page to look at (report.html) into a folder.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import first_upper, number, quantity
from hydraulic_sysid.data.records import Record, read_all
from hydraulic_sysid.diagnosis.compare import ComparisonError, Settings, compare
from hydraulic_sysid.diagnosis.compare.findings import AT_FLOOR
from hydraulic_sysid.verbs import _cli as cli

EPILOG = """\
examples:
  python -m hydraulic_sysid compare --model sample_bench --record examples/sample_bench --out runs/first
  python -m hydraulic_sysid compare --model my.yaml --record runs/bag --horizon 1 --out runs/bag-compared
"""
_LISTED = 3  # findings on the terminal; all of them stand in the results


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("compare", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("--model", metavar="FILE", required=True, help="model file, or the name of a preset")
    cli.add_record_options(parser)
    add_window_option(parser)
    parser.add_argument("--horizon", metavar="SECONDS", type=float, default=0.5, help="how far ahead (default 0.5)")
    add_folder_options(parser)
    return cli.run(parser, _compare, argv, errors=(ModelError, SimulationError, ComparisonError, results.ResultError))


def add_window_option(parser: argparse.ArgumentParser) -> None:
    """``--window T0 T1``: the part of every record to use."""
    parser.add_argument(
        "--window", metavar=("T0", "T1"), type=float, nargs=2, help="use this part of every record only, in seconds"
    )


def add_folder_options(parser: argparse.ArgumentParser) -> None:
    """``--out DIR`` and ``--json``; a run's folder keeps what is not the verb's own."""
    parser.add_argument(
        "--out", metavar="DIR", type=cli.Path, required=True, help="folder of the results; others in it are kept"
    )
    parser.add_argument(
        "--json", action="store_true", help="print the result as JSON (without traces) instead of a table"
    )


def read_window(options: argparse.Namespace) -> list[Record]:
    """The records that the command line names, or their part."""
    records = read_all(options.record, options.columns)
    return [r.window(*options.window) for r in records] if options.window else records


def summary_json(result: dict[str, Any], bulky: tuple[str, ...]) -> str:
    """The document without the named entries of its records: what fits a terminal or a pipe."""

    def slim(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: slim(v) for k, v in value.items() if k not in bulky}
        return [slim(v) for v in value] if isinstance(value, list) else value

    return json.dumps(slim(results.plain(result)), indent=2, ensure_ascii=False, allow_nan=False)


def _compare(options: argparse.Namespace) -> int:
    results.check_target(options.out, "compare")
    model = load_model(options.model)
    records = read_window(options)
    console = Console(stderr=True)
    with console.status("comparing …") as status:
        result = compare(
            model, records, Settings(horizon=options.horizon), lambda name: status.update(f"comparing {name} …")
        )
        status.update("writing the report …")
        page = _write(options, result)
    if options.json:
        print(summary_json(result, ("traces", "drive", "error_maps", "spectra", "error_growth")))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{page}")
    return cli.OK


def _write(options: argparse.Namespace, result: dict[str, Any]) -> str:
    from hydraulic_sysid.report import write_page

    results.write_result(options.out, result)
    return str(write_page(options.out, results.read_folder(options.out)))


def _print(result: dict[str, Any], console: Console) -> None:
    channels = _telling(result)
    horizon = f"{result['settings']['horizon']:g} s ahead"
    table = Table(
        title=f"{result['model']['name']}: RMS error {horizon} (× that of an exact model)", title_justify="left"
    )
    table.add_column("record", no_wrap=True)
    for name in channels:
        table.add_column(first_upper(result["channels"][name]["title"]), justify="right")

    def row(title: str, figures: list[dict[str, Any] | None], **style: Any) -> None:
        cells = [
            "–" if f is None else f"{quantity(f['rmse'], result['channels'][n]['unit'])} ({_ratio(f)})"
            for n, f in zip(channels, figures, strict=True)
        ]
        table.add_row(title, *cells, **style)

    for record in result["records"]:
        row(record["name"], [record["channels"].get(n, {}).get("horizon") for n in channels])
    table.add_section()
    row("all", [result["summary"][n]["horizon"] for n in channels], style="bold")
    noise = ((result["summary"][n]["noise_std"], result["channels"][n]["unit"]) for n in channels)
    table.add_row("noise", *(quantity(size, unit) for size, unit in noise))
    console.print(table)
    console.print(result["verdict"]["text"])
    for finding in [f for f in result["findings"] if f["kind"] in ("bias", "depends_on")][:_LISTED]:
        if finding["text"] not in result["verdict"]["text"]:
            console.print(f"• {finding['text']}")


def _telling(result: dict[str, Any]) -> list[str]:
    """Channels for a terminal's width: the load pressure stands for both chambers, what is always met is left out."""
    summary = result["summary"]
    hidden = {"pressure_a", "pressure_b"} if "load_pressure" in summary else set()
    hidden |= {n for n in ("pressure_supply", "spool") if n in summary and summary[n]["horizon"]["ratio"] <= AT_FLOOR}
    return [name for name in result["channels"] if name not in hidden]


def _ratio(figures: dict[str, Any]) -> str:
    return f"{number(figures['rmse'] / figures['exact_rmse'])}×" if figures["exact_rmse"] else "–"


if __name__ == "__main__":
    sys.exit(main())
