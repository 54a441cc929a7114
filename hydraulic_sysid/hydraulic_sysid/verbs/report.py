"""Make the page of a run's results again, from their JSON alone.

One HTML file without any other file or network behind it: the figures of every result in the folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from hydraulic_node_utils import cli
from hydraulic_sysid.data import results
from hydraulic_sysid.verbs import _options as opt


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("report", __doc__)
    parser.add_argument("results", metavar="PATH", type=Path, help="folder with results, or one result's JSON file")
    parser.add_argument("--out", metavar="DIR", type=Path, help="folder of the page (default: that of the results)")
    return cli.run(parser, _report, argv)


def _report(options: argparse.Namespace) -> None:
    found = results.read_folder(options.results)
    folder = options.out or (options.results if options.results.is_dir() else options.results.parent)
    results.check_page(folder)
    from hydraulic_sysid.report import write_page

    print(write_page(folder, found))
