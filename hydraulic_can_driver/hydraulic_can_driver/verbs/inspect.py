"""``inspect [--bus F] [--interface I] [--channel C] [--json]``: what the devices do to drive and measurements.

Reads only; nothing is written and nothing moves. Not to be used while the driver runs: two would ask the same devices.
"""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import closing
from dataclasses import replace

from rich.console import Console

from hydraulic_can_driver import readback
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus_file import load_bus, shipped
from hydraulic_node_utils import cli, tables


def main(argv: list[str] | None = None) -> int:
    """Print the settings of all devices. Exit code 0; 1 when a device does not answer as it should; 2 bad usage."""
    parser = cli.parser("hydraulic_can_driver inspect", "Read back the settings of the devices on the bus.")
    parser.add_argument(
        "--bus", default="bench", metavar="F", help=f"bus file, or a shipped one: {', '.join(shipped())}"
    )
    parser.add_argument("--interface", default="", metavar="I", help="python-can interface; default: that of the file")
    parser.add_argument("--channel", default="", metavar="C", help="its channel; default: that of the file")
    parser.add_argument("--json", action="store_true", help="print JSON, as it is kept with a record")
    return cli.run(parser, _inspect, argv)


def _inspect(options: argparse.Namespace) -> None:
    bus = load_bus(options.bus)
    bus = replace(bus, interface=options.interface or bus.interface, channel=options.channel or bus.channel)
    with closing(Bench(bus)) as bench:
        bench.inspect()
    found = readback.description(bus, bench.readings)
    if options.json:
        print(json.dumps(found, indent=2))
    else:
        _show(found)


def _show(found: dict) -> None:
    columns = ("device", "setting", "object", "value", "neutral", "looks like")
    table = tables.table(f"settings of the devices on {found['bus']}", columns)
    for name, device in found["devices"].items():
        for row in device["settings"]:
            neutral = "" if row["neutral"] is None else f"{row['neutral']:g} {row['unit']}"
            style = "bold" if row["acts"] else "dim"
            effect = row["effect"] if row["acts"] else ""
            table.add_row(
                name, row["name"], row["object"], f"{row['value']:g} {row['unit']}", neutral, effect, style=style
            )
        table.add_section()
    console = Console()
    console.print(table)
    if found["imitated_effects"]:
        console.print(f"The devices imitate these effects of the hydraulics: {', '.join(found['imitated_effects'])}.")
    else:
        console.print("All settings are neutral: nothing but the hydraulics shapes the records.")


if __name__ == "__main__":
    sys.exit(main())
