"""The command line that all verbs have: one form of help, one way for errors to reach the user, one list of verbs.

Exit codes: 0 done; 1 done with a negative result, or the work failed; 2 bad usage or bad input; 130 interrupted. An
error of the user's input, files or bench (`HydraulicError`, `OSError`) is one clear message on standard error; an
error of the program is a traceback. A verb is a module of its package's ``verbs``::

    def main(argv: list[str] | None = None) -> int:
        parser = cli.parser("hydraulic_sim effects", "List the physical effects.")
        parser.add_argument(…)
        return cli.run(parser, _effects, argv)
"""

from __future__ import annotations

import argparse
import ast
import importlib
import os
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

from hydraulic_interfaces.errors import HydraulicError

OK, NEGATIVE, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


class UsageError(HydraulicError):
    """The command line asks for something that cannot be done; the message says what and what can."""


def parser(program: str, description: str, epilog: str | None = None) -> argparse.ArgumentParser:
    """An argument parser in the common form; description and epilog keep their line breaks."""
    return argparse.ArgumentParser(
        prog=program,
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )


def run(
    parser: argparse.ArgumentParser,
    action: Callable[[argparse.Namespace], int | None],
    argv: Sequence[str] | None = None,
    stopped: str = "",
) -> int:
    """Parse ``argv``, call ``action`` and return the exit code; None from it counts as 0.

    :param stopped: what the user is told besides where the run was interrupted
    """
    try:
        code = action(parser.parse_args(argv))
        sys.stdout.flush()
        return OK if code is None else code
    except SystemExit as stop:  # argparse has printed the help or what is wrong
        return int(stop.code or 0)
    except BrokenPipeError:
        # The reader of our output (head, less) has gone; keep Python's own flush at exit quiet about it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except KeyboardInterrupt:
        print(f"{parser.prog}: interrupted{stopped and '; ' + stopped}", file=sys.stderr)
        return INTERRUPTED
    except HydraulicError as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return error.exit_code
    except OSError as error:
        text = str(error) if error.filename is None else f"{error.filename}: {error.strerror}"
        print(f"{parser.prog}: {text}", file=sys.stderr)
        return BAD_INPUT


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


def new_path(path: Path, overwrite: bool = False, hint: str = "choose another path") -> Path:
    """``path``, if there is a folder for it, and nothing there yet or what is there may be overwritten.

    :raises UsageError: otherwise, with ``hint`` where something is there.
    """
    if (path.exists() or path.is_symlink()) and not overwrite:
        raise UsageError(f"{path} exists; {hint}")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"{path}: the folder {path.absolute().parent} does not exist")
    return path


def verbs(package: str) -> dict[str, str]:
    """Names of a package's verbs with the first line of each one's docstring, sorted.

    The lines are read from the sources: importing all verbs would be slow.
    """
    spec = find_spec(f"{package}.verbs")
    assert spec is not None and spec.submodule_search_locations
    files = sorted(file for folder in spec.submodule_search_locations for file in Path(folder).glob("[!_]*.py"))
    texts = {file.stem: ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) for file in files}
    return {name: (text or "").partition("\n")[0] for name, text in texts.items()}


def run_verb(package: str, argv: Sequence[str] | None = None) -> int:
    """``python -m PACKAGE VERB …``: hand over to the verb; its exit code. Without one, list them."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    name, known = arguments[0] if arguments else "", verbs(package)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read by numpy; matrices are small, more threads only spin
    if name in known:
        return int(importlib.import_module(f"{package}.verbs.{name}").main(arguments[1:]))
    if name not in ("", "-h", "--help"):
        print(f"{package}: no verb {name!r}; there are {', '.join(known)}", file=sys.stderr)
        return BAD_INPUT
    width = max(map(len, known)) + 2
    lines = [f"  {verb:<{width}}{summary}" for verb, summary in known.items()]
    print(f"usage: python -m {package} VERB …   (VERB --help for its options)\n", *lines, sep="\n")
    return OK if name else BAD_INPUT
