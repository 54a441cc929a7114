"""Command line of `./bench`: finds the verb, turns every failure into a message and an exit code."""

from __future__ import annotations

import importlib
import io
import os
import pkgutil
import signal
import sys
import traceback
from pathlib import Path
from types import ModuleType

from . import verbs
from .bench import Bench
from .checkout import Checkout
from .errors import BenchError, UsageError

INTERRUPTED = 130


def verb_names() -> list[str]:
    """Verbs of `./bench`: the modules in `verbs/`, in the order a user meets them (their `ORDER`)."""
    names = [module.name for module in pkgutil.iter_modules(verbs.__path__)]
    return sorted(names, key=lambda name: load(name).ORDER)


def load(name: str) -> ModuleType:
    """Module of one verb: first line of docstring `usage: what it does`, `ORDER`, `run(bench, arguments)`."""
    return importlib.import_module(f"{verbs.__name__}.{name}")


def help_text() -> str:
    """What `./bench --help` prints."""
    lines = ["usage: ./bench VERB …", "", "Hydraulic test bench. Verbs:", ""]
    for name in verb_names():
        usage, _, summary = (load(name).__doc__ or "").strip().splitlines()[0].partition(": ")
        lines.append(f"  {usage:24} {summary}")
    lines += [
        "",
        "./bench VERB --help says more. The first call sets everything up (about a minute), later ones start",
        "at once. A sourced ROS 2 Jazzy is used; without one .venv gets its wheels. BENCH_PYTHON names the",
        "Python to use (3.10 to 3.13).",
    ]
    return "\n".join(lines)


def main(arguments: list[str]) -> int:
    """Run one call of `./bench`; returns its exit code."""
    for number in (signal.SIGINT, signal.SIGTERM):  # SIGINT too: a job in the background of a script ignores it,
        signal.signal(number, _interrupt)  # and all that is started here would inherit that
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # an old terminal's encoding is no reason to fail
    checkout = Checkout.of_this_file()
    try:
        return _run(Bench(checkout, os.environ), arguments)
    except BenchError as error:
        print(f"bench: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("\nbench: stopped.", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # the reader of a pipe left: nothing to say
        return 0
    except Exception as error:
        print(f"bench: unexpected {type(error).__name__}: {error}\n  see: {_keep(checkout)}", file=sys.stderr)
        return 1


def _run(bench: Bench, arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(help_text())
        return 0
    name, *rest = arguments
    if name not in verb_names():
        raise UsageError(f"There is no verb {name!r}.", remedy=f"use one of {', '.join(verb_names())}; ./bench --help")
    return load(name).run(bench, rest)


def _keep(checkout: Checkout) -> Path | str:
    """Write the traceback to a file; where that fails too, give it back."""
    text = traceback.format_exc()
    try:
        checkout.logs.mkdir(parents=True, exist_ok=True)
        file = checkout.logs / "error.log"
        file.write_text(text, encoding="utf-8")
        return file
    except OSError:
        return text


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
