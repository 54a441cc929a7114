"""``checklist [--bus FILE] [--out FILE]``: what to check at the first power-on of a bench, from its bus file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hydraulic_can_driver.bus_file import load_bus, shipped
from hydraulic_can_driver.checklist import checklist
from hydraulic_node_utils import cli


def main(argv: list[str] | None = None) -> int:
    """Print the list as Markdown, or write it to a new file; 0, or 2 for an unusable bus file or target."""
    parser = cli.parser(
        "hydraulic_can_driver checklist", "What to check before the hydraulics of a bench are first switched on."
    )
    parser.add_argument("--bus", default="bench", help=f"bus file, or a shipped one: {', '.join(shipped())}")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write Markdown to this new file")
    return cli.run(parser, _checklist, argv)


def _checklist(options: argparse.Namespace) -> None:
    text = checklist(load_bus(options.bus))
    if options.out is None:
        print(text, end="")
    else:
        cli.new_path(options.out, hint="name a new file").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
