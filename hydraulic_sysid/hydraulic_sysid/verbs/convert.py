"""Convert records: bags and tables to Parquet, HDF5, MATLAB, CSV or bags.

Every record that is read becomes one file (a bag: one folder) of its name. Numbers stay as they are, in SI units; what
is known of a record besides its channels goes with it, but for CSV.
"""

from __future__ import annotations

import argparse
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from hydraulic_node_utils import cli
from hydraulic_sysid.data.records import Record, save, to_bag
from hydraulic_sysid.data.records.formats import SUFFIXES
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid convert --record runs/bag --to parquet --out tables
  python -m hydraulic_sysid convert --record logs --columns my_map.yaml --to bag --out bags
"""
BAG = "bag"
KINDS = (*(suffix[1:] for suffix in SUFFIXES if not suffix.startswith(".txt")), BAG)  # .txt: of loggers, read alone


def main(argv: list[str] | None = None) -> int:
    """Write the files. Exit code 0; 2 for records that cannot be read or names that are taken, and none is written."""
    parser = opt.parser("convert", __doc__ or "", EPILOG)
    opt.add_record_options(parser)
    parser.add_argument("--to", choices=KINDS, required=True, metavar="KIND", help=f"one of {', '.join(KINDS)}")
    parser.add_argument("--out", type=Path, metavar="DIR", required=True, help="folder of the files; others are kept")
    return cli.run(parser, _convert, argv)


def _convert(options: argparse.Namespace) -> None:
    with Console(stderr=True).status("reading …") as status:
        records = opt.read_records(options)
        targets = _targets(records, options.out, "" if options.to == BAG else f".{options.to}")
        options.out.mkdir(parents=True, exist_ok=True)
        for record, target in zip(records, targets, strict=True):
            status.update(f"writing {target} …")
            (to_bag if options.to == BAG else save)(record, target)
    for record, target in zip(records, targets, strict=True):
        print(f"{target}: {len(record)} samples, every {record.dt:.6g} s: {', '.join(record.channels)}")


def _targets(records: Iterable[Record], folder: Path, suffix: str) -> list[Path]:
    """Where each record goes, all of them new.

    :raises UsageError: two records have one name, or there is something already.
    """
    targets = [folder / (re.sub(r"[^\w.+-]+", "_", record.name).strip("_") + suffix) for record in records]
    twice = [str(target) for target, count in Counter(targets).items() if count > 1]
    if twice:
        raise cli.UsageError(f"several records would become {twice[0]}; convert them into folders of their own")
    opt.check_new(folder, *(target.name for target in targets), what="record")
    return targets
