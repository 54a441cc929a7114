"""What the verbs' command lines share: option names, error texts and exit codes.

Exit codes: 0 done, 1 done with a negative result, 2 bad usage or bad input, 130 interrupted. An error of the
user's input is one clear line on standard error, never a traceback; an error of the program is a traceback.

A verb reads::

    def main(argv: list[str] | None = None) -> int:
        parser = cli.parser("compare", "Compare a model with records.")
        cli.add_record_options(parser)
        cli.add_output_options(parser, "folder of the report")
        return cli.run(parser, _compare, argv)
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.errors import HydraulicSimError

PROGRAM = "hydraulic_sysid"
OK, NEGATIVE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


class UsageError(HydraulicError):
    """The command line asks for something that cannot be done; the message says what and what can."""


def parser(verb: str, description: str, epilog: str | None = None) -> argparse.ArgumentParser:
    """An argument parser in the common form; ``epilog`` keeps its line breaks."""
    return argparse.ArgumentParser(
        prog=f"{PROGRAM} {verb}",
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )


def add_record_options(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """``--record PATH …`` (one or more) and ``--columns MAP``; read them with `records.read_all`."""
    parser.add_argument(
        "--record",
        metavar="PATH",
        type=Path,
        nargs="+",
        action="extend",
        required=required,
        default=None if required else [],
        help="record to read: bag folder, .csv, .csv.gz, .mat, or a folder of such",
    )
    parser.add_argument(
        "--columns",
        metavar="MAP",
        help="column map of CSV and MAT records: a YAML file or the name of a map that is shipped",
    )


def add_output_options(parser: argparse.ArgumentParser, what: str, *, required: bool = False) -> None:
    """``--out PATH`` (where ``what`` is written), ``--overwrite`` and ``--json`` (result as JSON on stdout)."""
    parser.add_argument("--out", metavar="PATH", type=Path, required=required, help=f"write here: {what}")
    parser.add_argument("--overwrite", action="store_true", help="replace what is at --out")
    parser.add_argument("--json", action="store_true", help="print the result as JSON instead of a table")


def new_path(path: Path, overwrite: bool = False) -> Path:
    """``path``, if nothing is there or it may be overwritten.

    :raises UsageError: something is there, or the folder it should go into is missing.
    """
    if (path.exists() or path.is_symlink()) and not overwrite:
        raise UsageError(f"{path} exists; choose another path, or allow --overwrite")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"{path}: the folder {path.absolute().parent} does not exist")
    return path


def run(
    parser: argparse.ArgumentParser,
    action: Callable[[argparse.Namespace], int | None],
    argv: Sequence[str] | None = None,
    errors: tuple[type[Exception], ...] = (),
) -> int:
    """Parse ``argv``, call ``action`` and return the exit code; None from it counts as 0.

    `HydraulicError`, `HydraulicSimError`, `OSError` and ``errors`` are the user's: printed, exit code 2.
    """
    bad_input: tuple[type[Exception], ...] = (HydraulicError, HydraulicSimError, OSError, *errors)
    try:
        options = parser.parse_args(argv)
    except SystemExit as stop:  # argparse has printed the help or what is wrong
        return int(stop.code or 0)
    try:
        code = action(options)
        sys.stdout.flush()
        return OK if code is None else code
    except BrokenPipeError:
        # The reader of our output (head, less) has gone; keep Python's own flush at exit quiet about it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt:
        print(f"{parser.prog}: interrupted", file=sys.stderr)
        return INTERRUPTED
    except bad_input as error:
        print(f"{parser.prog}: {_text(error)}", file=sys.stderr)
        return BAD_INPUT


def _text(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return str(error)
