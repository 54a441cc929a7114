"""What the verbs of this package share: options that several of them have, and the way from options to a page.

A verb reads::

    def main(argv: list[str] | None = None) -> int:
        parser = opt.parser("compare", __doc__, EPILOG)
        opt.add_model_option(parser)
        opt.add_record_options(parser)
        return opt.run(parser, _compare, _show, argv)
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_node_utils import cli, tables
from hydraulic_node_utils.interrupts import finishing
from hydraulic_node_utils.large_arrays import give_back
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import Record, read_all
from hydraulic_sysid.data.records.formats import SUFFIXES
from hydraulic_sysid.data.records.paired import paired

MODEL = "model.yaml"
Say = Callable[[str], None]
"""Takes what is being done now, for the line that a user watches meanwhile."""


@dataclass(frozen=True)
class Done:
    """What a verb has come to: its document, what writes further files into the run's folder, and whether it is well.

    The exit code is 0, or 1 where ``good`` is false. ``notes`` say why something that was asked for was not written.
    """

    result: dict[str, Any]
    files: Mapping[str, Callable[[Path], object]] = field(default_factory=dict)
    good: bool = True
    notes: Sequence[str] = ()


def parser(verb: str, doc: str, epilog: str | None = None) -> argparse.ArgumentParser:
    """The parser of a verb, described by the first line of its module's docstring."""
    return cli.parser(f"hydraulic_sysid {verb}", doc.partition("\n")[0], epilog)


def run(
    parser: argparse.ArgumentParser,
    work: Callable[[argparse.Namespace, Say], Done],
    show: Callable[[dict[str, Any], Console], None],
    argv: Sequence[str] | None = None,
    bulky: Sequence[str] = (),
) -> int:
    """Do a verb's work, keep its document, files and page in ``--out``, and show it; the exit code.

    :param show: prints the result as tables
    :param bulky: entries that ``--json`` leaves out
    """
    verb = parser.prog.rpartition(" ")[2]
    parser.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="folder of the results; others in it are kept"
    )
    parser.add_argument(
        "--json", action="store_true", help="print the result as JSON (without traces) instead of a table"
    )
    parser.add_argument(
        "--progress", action="store_true", help="print what is being done as lines of JSON, for other programs"
    )

    def action(options: argparse.Namespace) -> int:
        give_back()
        folder: Path = options.out
        results.check_target(folder, verb)
        with Console(stderr=True).status(f"{verb} …") as status:
            say = tell_programs if options.progress else lambda text: status.update(f"{text} …")
            done = work(options, say)
            with finishing():
                say("writing the report")
                result = {**done.result, **reading(options)}
                results.write_result(folder, result)
                for name, write in done.files.items():
                    write(folder / name)
                from hydraulic_sysid.report import write_page  # takes long to import, and --help needs none

                page = write_page(folder, results.read_folder(folder))
        if options.json:
            slim = _without(results.plain(result), bulky)
            print(json.dumps(slim, indent=2, ensure_ascii=False, allow_nan=False))
        else:
            show(done.result, tables.console())
            print("", *(folder / name for name in done.files), page, sep="\n")
        for note in done.notes:
            print(note, file=sys.stderr)
        return cli.OK if done.good else cli.NEGATIVE

    return cli.run(parser, action, argv)


def tell_programs(text: str = "", **more: Any) -> None:
    """A line of JSON on standard error: what is being done (``progress``), or ``more`` that a verb tells meanwhile."""
    told = {"progress": text, **more} if text else more
    print(json.dumps(results.plain(told), ensure_ascii=False, allow_nan=False), file=sys.stderr, flush=True)


def watch(options: argparse.Namespace) -> Callable[[Mapping[str, Any]], None] | None:
    """What takes the findings of a search while it goes on: for the programs that asked for them."""
    return (lambda found: tell_programs(**found)) if options.progress else None


def _without(value: Any, names: Sequence[str]) -> Any:
    """The document without the entries of those names, wherever they stand: what fits a terminal or a pipe."""
    if isinstance(value, dict):
        return {k: _without(v, names) for k, v in value.items() if k not in names}
    return [_without(v, names) for v in value] if isinstance(value, list) else value


def add_model_option(
    parser: argparse.ArgumentParser,
    what: str = "model file, or the name of a preset",
    within: argparse._MutuallyExclusiveGroup | None = None,
) -> None:
    """``--model FILE``, one of a group ``within`` which others are; read it with `load_model`. And ``--trust DIR``."""
    (within or parser).add_argument("--model", metavar="FILE", required=within is None, help=what)
    add_trust_option(parser)


def add_record_options(parser: argparse.ArgumentParser, *, required: bool = True, window: bool = True) -> None:
    """``--record PATH …``, ``--columns MAP`` and ``--window T0 T1``; read them with `read_records`."""
    parser.add_argument(
        "--record",
        metavar="PATH",
        type=Path,
        nargs="+",
        action="extend",
        required=required,
        default=None if required else [],
        help=f"record to read: a bag, a table ({', '.join(SUFFIXES)}), or a folder of such",
    )
    parser.add_argument(
        "--columns",
        metavar="MAP",
        help="column map of records that are tables: a YAML file or the name of a map that is shipped",
    )
    if window:
        parser.add_argument(
            "--window", metavar=("T0", "T1"), type=float, nargs=2, help="use this part of every record only, in seconds"
        )


def read_records(options: argparse.Namespace) -> list[Record]:
    """The records that the command line names, `paired`, or their part; none where it names none."""
    records = paired(read_all(options.record, options.columns)) if options.record else []
    window = getattr(options, "window", None)
    return [r.window(*window) for r in records] if window else records


def reading(options: argparse.Namespace) -> dict[str, Any]:
    """The entry ``reading`` of a document: by option, which records the command line names and how they are read.

    What the page suggests next is to read the same. Nothing where a verb or its call names none.
    """
    paths = {name: getattr(options, name, None) for name in ("record", "validation", "holdout")}
    # Some verbs hold out a part of every record, and no files.
    files = {name: [str(path) for path in given] for name, given in paths.items() if isinstance(given, list) and given}
    others = {name: getattr(options, name, None) for name in ("columns", "window", "segment")}
    if "record" not in files:
        return {}
    return {"reading": {**files, **{name: value for name, value in others.items() if value is not None}}}


def read_kept_back(paths: list[Path] | None, options: argparse.Namespace) -> list[Record]:
    """Records that an option of their own names; none where it does not."""
    return paired(read_all(paths, options.columns)) if paths else []


def add_part_options(parser: argparse.ArgumentParser, part: float) -> None:
    """``--holdout PART`` or ``--holdout-record PATH …``: what is kept from the fit."""
    held = parser.add_mutually_exclusive_group()
    held.add_argument(
        "--holdout", metavar="PART", type=float, default=part,
        help=f"last part of every record to hold out (default {part:g})",
    )  # fmt: skip
    held.add_argument("--holdout-record", metavar="PATH", type=Path, nargs="+", help="records to hold out instead")


def add_channel_options(parser: argparse.ArgumentParser) -> None:
    """``--input`` and ``--output``: the channels that a linear model stands between."""
    parser.add_argument("--input", metavar="CHANNEL", default="drive", help="input channel (default drive)")
    parser.add_argument("--output", metavar="CHANNEL", default="position", help="output channel (default position)")


def add_period_options(parser: argparse.ArgumentParser) -> None:
    """``--period`` and ``--start`` of an excitation that no plan describes."""
    parser.add_argument("--period", metavar="SECONDS", type=float, help="of the excitation, where no plan tells it")
    parser.add_argument("--start", metavar="SECONDS", type=float, default=0.0, help="where its periods begin")


def add_diagnosis_options(parser: argparse.ArgumentParser) -> None:
    """Model, records, records for validation and for a test, length of a segment."""
    add_model_option(parser)
    add_record_options(parser)
    parser.add_argument(
        "--validation",
        metavar="PATH",
        type=Path,
        nargs="+",
        help="records for validation: no fit sees them, but they decide what is added (default: every third block of "
        "every record)",
    )
    parser.add_argument(
        "--holdout",
        metavar="PATH",
        type=Path,
        nargs="+",
        help="test data: records that neither a fit nor the choice of what is added sees (default: what is left of "
        "long records)",
    )
    add_segment_option(parser)


def add_segment_option(parser: argparse.ArgumentParser) -> None:
    """``--segment SECONDS``: how long the segments are whose initial states are fitted too."""
    parser.add_argument(
        "--segment",
        "--piece",
        metavar="SECONDS",
        type=cli.positive,
        help="length of a segment (default 0.5, or 25 periods of the oil's oscillation where these are shorter)",
    )


LIMITS = {
    "drive": ("V", "largest drive"),
    "travel": ("m", "largest distance from the centre"),
    "velocity": ("m/s", "largest speed"),
    "pressure_min": ("Pa", "least pressure of a chamber"),
    "pressure_max": ("Pa", "largest pressure of a chamber"),
}


def add_limit_options(parser: argparse.ArgumentParser, default: str) -> None:
    """One option for each of `LIMITS`, with where its default comes from; read them with `given_limits`."""
    for name, (unit, what) in LIMITS.items():
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, metavar=unit, type=float, help=f"{what} (default: from the {default})")


def given_limits(options: argparse.Namespace) -> dict[str, float]:
    """The limits that the command line sets, by name."""
    return {name: getattr(options, name) for name in LIMITS if getattr(options, name) is not None}


def check_new(folder: Path, *patterns: str, what: str = "model") -> None:
    """Find out before the work that none of the files is there yet.

    :raises UsageError: one is there.
    """
    found = sorted(file for pattern in patterns for file in folder.glob(pattern))
    if found:
        raise cli.UsageError(
            f"{', '.join(map(str, found))} exists; choose another folder (a {what} is never overwritten)"
        )
