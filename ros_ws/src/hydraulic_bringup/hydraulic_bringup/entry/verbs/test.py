"""test [PYTEST ARG …]: build, ruff, mypy and all tests; with arguments only pytest on those.

All tests run in several pytest processes side by side, whose output is shown one after the other. Tests that keep time
and fail there are run once more with the machine to themselves, and said to be so. The last line printed is pytest's
closing line, or the sum of those. Exit code 0 only if everything passed.
"""

from __future__ import annotations

import codecs
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import chain
from pathlib import Path

from ..bench import Bench

ORDER = 2
COMPUTING = (("tests/hidden_effects",), ("tests/sim", "tests/sysid"))  # but for their nodes' tests, which keep time
NODES = "*_node.py"
MACHINE = "tests/system/test_vcan.py"  # where this kernel has no vcan, a virtual machine that takes all processors
FIRST = ("tests/system", "tests/contract")  # half of the waiting; any other folder goes to the rest
NICE = 15
NO_MEMORY = ("-p", "no:cacheprovider")
FAILED_TESTS = 1  # pytest's exit code; others mean that it was not able to run them
INTERRUPT_S = 15.0  # for pytest to end its node processes and to sum up
POLL_S = 0.1
COUNT = re.compile(r"(\d+) (passed|failed|errors?|skipped|xfailed|xpassed|deselected|repeated|warnings?)\b")


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up what is missing, then check the sources and run the tests."""
    if arguments in (["-h"], ["--help"]):
        print(f"usage: ./bench {__doc__}")
        return 0
    bench.prepare()
    variables = bench.variables()
    python = str(bench.checkout.python)
    checks = {} if arguments else {"ruff": ["ruff", "check", "."], "mypy": ["mypy"]}
    failed = []
    for name, command in checks.items():
        print(f"== {name}", flush=True)
        if subprocess.call([python, "-m", *command], cwd=bench.checkout.root, env=variables):
            failed.append(name)
    root = bench.checkout.root
    pytest = [python, "-m", "pytest"]
    if arguments or not all((root / folder).is_dir() for folder in chain(*COMPUTING)):
        here = Path.cwd() if root in Path.cwd().parents else root  # so that given paths mean what they say
        only = Stream([*pytest, *arguments], here, variables)
        with ending([only]):
            closing = only.show()
        code = only.code
    else:
        code, closing = _all(pytest, root, variables)
    if failed:
        print(f"Failed before the tests, see above: {', '.join(failed)}\n{closing}", flush=True)
    return code or int(bool(failed))


def _all(pytest: list[str], root: Path, variables: Mapping[str, str]) -> tuple[int, str]:
    """All tests; the worst exit code, and the sum of the closing lines, which has been printed."""
    begun = time.monotonic()
    machine, halves = _keep_time(root)
    # These need no more than what the others leave of the processors.
    computing = [[*folders, f"--ignore-glob={NODES}"] for folders in COMPUTING]
    streams: list[Stream] = []
    with tempfile.TemporaryDirectory(prefix="bench_test_") as memory, ending(streams):

        def start(selection: Sequence[str], options: Sequence[str], nice: int = 0) -> Stream:
            streams.append(Stream([*pytest, *selection, *options], root, variables, " ".join(selection), nice))
            return streams[-1]

        def remember() -> list[str]:
            return ["-o", f"cache_dir={memory}/{len(streams)}"]

        beside = [start(selection, NO_MEMORY, NICE) for selection in computing]
        if machine:
            start(machine, remember()).show()
        for stream in (*[start(half, remember()) for half in halves], *beside):
            stream.show()
        for stream in [stream for stream in streams if stream not in beside and stream.code == FAILED_TESTS]:
            stream.superseded = True
            streams.append(Stream([*stream.command, "--last-failed"], root, variables, f"{stream.title}: again, alone"))
            streams[-1].show()
    closing = summed([stream.counted for stream in streams], time.monotonic() - begun)
    bad = [stream for stream in streams if stream.code and not stream.superseded]
    if bad:
        print("Failed, see above:", *(stream.closing for stream in bad), sep="\n  ")
    print(closing, flush=True)
    return max((abs(stream.code) for stream in bad), default=0), closing


def _keep_time(root: Path) -> tuple[list[str], tuple[list[str], list[str]]]:
    """Selections of the tests that keep time: what has to have the machine for itself, and two halves of the rest."""
    machine = [MACHINE] if (root / MACHINE).is_file() else []
    folders = [str(d.relative_to(root)) for d in sorted((root / "tests").iterdir()) if any(d.glob("test_*.py"))]
    nodes = [str(f.relative_to(root)) for folder in chain(*COMPUTING) for f in sorted((root / folder).glob(NODES))]
    first = [folder for folder in FIRST if folder in folders]
    rest = [folder for folder in folders if folder not in (*FIRST, *chain(*COMPUTING))]
    return machine, ([*first, *(f"--ignore={file}" for file in machine)], [*rest, *nodes])


def summed(closings: Sequence[str], seconds: float) -> str:
    """One closing line in pytest's manner from several; a run without one is counted as an error."""
    counts: Counter[str] = Counter()
    for closing in closings:
        found = COUNT.findall(closing)
        counts.update({"errors": 1} if not found else {})
        for number, what in found:
            counts[{"error": "errors", "warning": "warnings"}.get(what, what)] += int(number)
    order = ("failed", "passed", "skipped", "deselected", "xfailed", "xpassed", "repeated", "warnings", "errors")
    told = ", ".join(f"{counts[what]} {what}" for what in order if counts[what])
    return f"=== {told} in {seconds:.2f}s ({int(seconds) // 60} min {int(seconds) % 60} s) ==="


class Stream:
    """A pytest that has been started and writes to a file; `show` prints that, then `code` and `closing` are there."""

    def __init__(
        self, command: list[str], folder: Path, variables: Mapping[str, str], title: str = "", nice: int = 0
    ) -> None:
        size = {"COLUMNS": str(shutil.get_terminal_size().columns)}
        colour = ["--color=yes"] if sys.stdout.isatty() else []
        self.closing = ""
        self.superseded = False  # its failures have been run again
        self.command, self.title = command, title
        self._file = tempfile.NamedTemporaryFile(prefix="bench_test_")  # noqa: SIM115 - until `close`
        self._process = subprocess.Popen(
            [*command, *colour],
            cwd=folder,
            env={**variables, **size},
            stdout=self._file,
            stderr=subprocess.STDOUT,
            preexec_fn=partial(os.nice, nice),
        )

    @property
    def code(self) -> int:
        """Exit code; it has to have ended."""
        return self._process.returncode

    @property
    def counted(self) -> str:
        """Its closing line for the sum: what another stream has run again is counted there."""
        return re.sub(r"\b(\d+) (failed|errors?)\b", r"\1 repeated", self.closing) if self.superseded else self.closing

    def show(self) -> str:
        """Print what it has written and writes, until it ends; its last line."""
        print(f"== pytest {self.title}".rstrip(), flush=True)
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        tail = ""
        with open(self._file.name, "rb") as source:
            ended = False
            while not ended:
                ended = self._process.poll() is not None  # before reading: what it wrote last must not be missed
                text = decoder.decode(source.read())
                sys.stdout.write(text)
                sys.stdout.flush()
                tail = (tail + text)[-4096:]
                if not ended and not text:
                    time.sleep(POLL_S)
        lines = [line for line in tail.splitlines() if line.strip()]
        self.closing = lines[-1] if lines else ""
        return self.closing

    def interrupt(self) -> None:
        """As Ctrl-C does; on a terminal it got that itself."""
        if not sys.stdout.isatty():
            self._process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """Wait for its end, and end it if it does not come."""
        try:
            self._process.wait(INTERRUPT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._file.close()


@contextmanager
def ending(streams: Sequence[Stream]) -> Iterator[None]:
    """Leave no pytest behind: whoever waits for them may be interrupted."""
    try:
        yield
    except BaseException:
        for stream in streams:
            stream.interrupt()
        raise
    finally:
        for stream in streams:
            stream.close()
