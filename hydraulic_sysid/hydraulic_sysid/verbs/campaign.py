"""Run a verb over many records, models and options, on all processors or a Dask cluster.

WHAT is a manifest, a YAML file with the keys verb, records, models and options, or the name of a verb, whose records
and models then follow as patterns. Each combination is a case, and each case a call of the verb. Results are kept as
they come: a campaign that was ended or killed goes on where it was, and what was computed is not computed again. A case
that fails is a row like the others. Writes campaign.json, a table (campaign.csv or .parquet), a page (report.html), and
each case's own report in cases/.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bar
from ruamel.yaml.error import YAMLError

from hydraulic_node_utils import cli, tables
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid import campaign
from hydraulic_sysid.campaign.document import document
from hydraulic_sysid.campaign.manifest import model_files, read_yaml, record_groups, variations
from hydraulic_sysid.campaign.table import FORMATS, write_table
from hydraulic_sysid.data import results
from hydraulic_sysid.verbs._campaign_options import add_crew_options, chosen_crew

EPILOG = """\
examples:
  python -m hydraulic_sysid campaign compare --record 'bags/*' --model sample_bench my.yaml --out runs/compared
  python -m hydraulic_sysid campaign diagnose --record 'bags/*' --model my.yaml --option '{within: 60}' --out runs/all
  python -m hydraulic_sysid campaign manifest.yaml --scheduler tcp://host:8786 --table parquet --out runs/all

exit codes: 0 every case has a result; 1 some failed (campaign.json and the table say why); 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("hydraulic_sysid campaign", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("what", metavar="WHAT", help="a manifest (.yaml), or a verb such as diagnose")
    parser.add_argument("--record", metavar="PATTERN", nargs="+", default=[], help="records; each match is a case")
    parser.add_argument("--model", metavar="PATTERN", nargs="+", default=[], help="model files or presets")
    parser.add_argument(
        "--option", metavar="YAML", action="append", default=[],
        help="options of the verb, such as '{segment: 0.3}'; each --option is a variation of its own",
    )  # fmt: skip
    parser.add_argument(
        "--figures", metavar="COLUMN", nargs="+", default=[], help="columns whose distributions to show"
    )
    add_crew_options(parser)
    parser.add_argument("--again", action="store_true", help="do cases once more that failed")
    parser.add_argument("--table", choices=FORMATS, default=FORMATS[0], help="format of the table (default csv)")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder of the results")
    add_trust_option(parser)
    return cli.run(parser, _campaign, argv, stopped="what is done is kept; the same call goes on")


def _campaign(options: argparse.Namespace) -> int:
    manifest = _manifest(options)
    results.check_target(options.out, "campaign")
    cases = campaign.verb_cases(manifest)
    for file in manifest.models.values():
        Plant(load_model(file))  # compiled once, before the workers start
    crew = chosen_crew(options)
    begun = time.monotonic()
    with ProgressLine(len(cases)) as line:
        outcomes = campaign.run(campaign.work, cases, options.out.resolve(), crew, line.told, options.again)
    result = document(manifest.verb, outcomes, crew.name, time.monotonic() - begun, options.figures)
    results.write_result(options.out, result)
    table = options.out / f"campaign.{options.table}"
    write_table(table, outcomes)
    from hydraulic_sysid.report import write_page  # takes long to import, and --help needs none

    page = write_page(options.out, [result])
    _show(result)
    print("", table, page, sep="\n")
    return cli.NEGATIVE if result["count"]["failed"] else cli.OK


def _manifest(options: argparse.Namespace) -> campaign.Manifest:
    if options.what.endswith((".yaml", ".yml")):
        if options.record or options.model or options.option:
            raise cli.UsageError("a manifest says itself which records, models and options there are")
        return campaign.load_manifest(Path(options.what))
    here = Path()
    entries = [_mapping(text) for text in options.option]
    return campaign.Manifest(
        options.what,
        record_groups(options.record, here, "--record"),
        model_files(options.model, here, "--model"),
        variations(entries, "--option"),
    )


def _mapping(text: str) -> dict[str, Any]:
    try:
        value = read_yaml(text)
    except YAMLError as error:
        raise cli.UsageError(f"--option {text!r} is no YAML: {error}") from error
    if not isinstance(value, dict):
        raise cli.UsageError(f"--option {text!r}: allowed is a mapping, such as '{{segment: 0.3}}'")
    return value


class ProgressLine:
    """One line on the terminal: cases done and failed, rate, time left."""

    def __init__(self, total: int) -> None:
        texts = (
            TextColumn("{task.fields[rate]}"),
            TextColumn("{task.fields[left]}"),
            TextColumn("{task.fields[last]}"),
        )
        self._bar = Bar(BarColumn(), MofNCompleteColumn(), *texts, console=Console(stderr=True))
        self._task = self._bar.add_task("", total=total, rate="", left="", last="")

    def __enter__(self) -> ProgressLine:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def told(self, progress: campaign.Progress) -> None:
        """Show how far the campaign is."""
        left = progress.seconds_left
        last = progress.last
        self._bar.update(
            self._task,
            completed=progress.before + progress.now,
            rate=f"{60.0 * progress.rate:.3g} cases/min" if progress.now else "",
            left="" if left is None else f"{left / 60.0:.0f} min left" if left > 90.0 else f"{left:.0f} s left",
            last=(f"{progress.failed} failed  " if progress.failed else "")
            + (" ".join(last.labels.values()) if last else ""),
        )


def _show(result: dict[str, Any]) -> None:
    count: dict[str, int] = result["count"]
    table = tables.table(f"{result['verb']}: {count['cases']} cases", ("|answer", ">cases"))
    for row in result["answers"]:
        table.add_row(row["answer"], str(row["count"]))
    console = tables.console()
    console.print(table)
    for case in _some([c for c in result["cases"] if c["state"] == "failed"]):
        console.print(f"failed: {case['record']} {case['model']} {case['options']}: {case['error']}", markup=False)


def _some(cases: Sequence[dict[str, Any]], most: int = 10) -> Sequence[dict[str, Any]]:
    return cases[:most]
