"""What the verbs' command lines share.

Exit codes: 0 done, 1 it could not be done, 2 bad usage or bad input, 130 interrupted. An error of the input is one
clear line on standard error, never a traceback.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from hydraulic_control.errors import HydraulicControlError
from hydraulic_sim.errors import HydraulicSimError

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


class FailedError(Exception):
    """The input was fine, the work could not be done; the message says why."""


def parser(verb: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """An argument parser in the common form; ``epilog`` keeps its line breaks."""
    return argparse.ArgumentParser(
        prog=f"hydraulic_control {verb}",
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )


def console() -> Console:
    """Standard output for tables, wide enough for them where it is no terminal."""
    found = Console(file=sys.stdout, highlight=False, markup=False, soft_wrap=False)
    if not found.is_terminal:
        found.width = 120
    return found


def positive(text: str) -> float:
    """A positive, finite number of an option."""
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def count(text: str) -> int:
    """A whole number of an option, at least 0."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def new_file(path: Path, overwrite: bool) -> Path:
    """``path``, if nothing is there or it may be overwritten. Raises `HydraulicControlError` otherwise."""
    if path.exists() and not overwrite:
        raise HydraulicControlError(f"{path} exists; choose another path, or allow --overwrite")
    if not path.absolute().parent.is_dir():
        raise HydraulicControlError(f"{path}: the folder {path.absolute().parent} does not exist")
    return path


def run(
    parser: argparse.ArgumentParser, action: Callable[[argparse.Namespace], None], argv: Sequence[str] | None
) -> int:
    """Parse ``argv``, call ``action`` and return the exit code."""
    try:
        options = parser.parse_args(argv)
    except SystemExit as stop:  # argparse has printed the help or what is wrong
        return int(stop.code or 0)
    try:
        action(options)
        sys.stdout.flush()
        return OK
    except BrokenPipeError:  # the reader (head, less) has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt:
        print(f"{parser.prog}: interrupted", file=sys.stderr)
        return INTERRUPTED
    except FailedError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return FAILED
    except (HydraulicControlError, HydraulicSimError) as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"{parser.prog}: {error.filename}: {error.strerror}", file=sys.stderr)
        return BAD_INPUT
