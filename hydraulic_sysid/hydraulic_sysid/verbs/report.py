"""Make the page of a run's results again, from their JSON alone.

One HTML file without any other file or network behind it: the figures of every result in the folder.
"""

from __future__ import annotations

import argparse
import sys

from hydraulic_sysid.data import results
from hydraulic_sysid.verbs import _cli as cli


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("report", __doc__.partition("\n")[0])
    parser.add_argument("results", metavar="PATH", type=cli.Path, help="folder with results, or one result's JSON file")
    parser.add_argument("--out", metavar="DIR", type=cli.Path, help="folder of the page (default: that of the results)")
    return cli.run(parser, _report, argv, errors=(results.ResultError,))


def _report(options: argparse.Namespace) -> int:
    found = results.read_folder(options.results)
    folder = options.out or (options.results if options.results.is_dir() else options.results.parent)
    results.check_page(folder)
    from hydraulic_sysid.report import write_page

    print(write_page(folder, found))
    return cli.OK


if __name__ == "__main__":
    sys.exit(main())
