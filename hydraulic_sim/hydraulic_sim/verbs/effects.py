"""``effects [NAME] [--json] [--file F]``: the library of physical effects."""

from __future__ import annotations

import argparse
import json
import sys

from rich.console import Console
from rich.table import Table

from hydraulic_node_utils import cli, tables

from .. import slots
from ..catalogue import describe, parameters_line
from ..registry import Library, library


def main(argv: list[str] | None = None) -> int:
    """Print the library, or one effect whole. Exit code 0, or 2 for an unknown name or an unusable effect file."""
    parser = cli.parser("hydraulic_sim effects", "List the physical effects a model can have.")
    parser.add_argument("name", nargs="?", help="one effect, shown whole")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--file", action="append", default=[], metavar="F", help="an effect file of your own as well")
    return cli.run(parser, _effects, argv)


def _effects(options: argparse.Namespace) -> None:
    found = library(options.file)
    records = [describe(found, name) for name in ([options.name] if options.name else found)]
    if options.json:
        print(json.dumps(records[0] if options.name else records, indent=2, ensure_ascii=False))
    elif options.name:
        _whole(records[0])
    else:
        _overview(found)


def _overview(found: Library) -> None:
    columns = ("|effect", "what it is", "parameters (default)")
    table = tables.table(f"{len(found)} effects", columns, caption="effects NAME shows one whole")
    slot = ""
    for effect in found.values():
        if effect.slot != slot:
            slot = effect.slot
            table.add_section()
            table.add_row(f"[bold]{slot}[/bold]", f"[dim]{slots.SLOTS[slot].what}[/dim]", "")
        summary = effect.summary + (" (always on)" if effect.always_on else "")
        table.add_row(f"  {effect.name}", summary, parameters_line(effect))
    Console().print(table)


def _whole(record: dict) -> None:
    console = Console(highlight=False)
    console.print(f"[bold]{record['name']}[/bold]: {record['summary']}")
    for label, key in (
        ("acts in", "slot"),
        ("acts on", "subsystem"),
        ("equation", "equation"),
        ("source", "source"),
        ("excited by", "excited_by"),
        ("distinguished by", "distinguished_by"),
        ("grows with wear of", "wear"),
        ("file", "file"),
    ):
        if not record[key]:
            continue
        console.print(f"  {label}: {record[key]}", markup=False)
    console.print(f"  easily taken for: {', '.join(record['confused_with']) or 'nothing'}", markup=False)
    table = Table()
    for heading in ("parameter", "unit", "default", "lowest", "highest", "null", "fit", "what", "source"):
        table.add_column(heading, overflow="fold")
    for p in record["parameters"]:
        low, high = p["bounds"]
        null = "" if p["null"] is None else f"{p['null']:g}"
        fit = "free" if p["free"] else "fixed"
        table.add_row(
            p["name"], p["unit"], f"{p['default']:g}", f"{low:g}", f"{high:g}", null, fit, p["description"], p["source"]
        )
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
