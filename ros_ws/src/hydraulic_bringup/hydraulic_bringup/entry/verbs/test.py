"""test [PYTEST ARG …]: build, ruff, mypy and all tests; with arguments only pytest on those.

The tests fill all processors; those of the wall clock (marker `timing`) run after all others, one after the other, but
for those with patience for a busy machine (marker `beside` as well), which run beside the others. Only those of the
wall clock are repeated, once and alone, where they fail. The last line printed is the sum of pytest's closing lines.
Exit code 0 only if everything passed.
"""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..bench import Bench

ORDER = 2
CHECKS = ("ruff", "check", "."), ("mypy",)
COMPILE = "from hydraulic_sim import model_file, plant; plant.Plant(model_file.load_model('sample_bench'))"
FAILED_TESTS = 1  # pytest's exit code; others mean that it was not able to run them
LONGEST_S = 2400.0  # about three times what two processors take; what hangs beyond it is interrupted and has failed
AHEAD = -10  # niceness of what runs beside the tests and is of the wall clock, where this user may give it
INTERRUPT_S = 15.0  # for pytest to end its node processes and to sum up
COUNT = re.compile(r"(\d+) (passed|failed|errors?|skipped|xfailed|xpassed|repeated|warnings?)\b")


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up what is missing, then check the sources and run the tests."""
    if arguments in (["-h"], ["--help"]):
        print(f"usage: ./bench {__doc__}")
        return 0
    bench.prepare()
    root, variables = bench.checkout.root, bench.variables()
    python = [str(bench.checkout.python), "-m"]
    if arguments:
        here = Path.cwd() if root in Path.cwd().parents else root  # so that given paths mean what they say
        endless = threading.TIMEOUT_MAX
        return Pytest([*python, "pytest", *arguments], here, variables, longest=endless).finish().code
    variables.pop("PYTHONDONTWRITEBYTECODE", None)  # each of hundreds of processes would compile all that it imports
    failed = []
    # Once, and beside the checks: else each of the workers would begin with it. The tests say what is wrong with it.
    with subprocess.Popen([python[0], "-c", COMPILE], cwd=root, env=variables):
        for name, *options in CHECKS:
            print(f"== {name}", flush=True)
            if subprocess.call([*python, name, *options], cwd=root, env=variables):
                failed.append(name)
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="bench_test_") as memory:

        def pytest(marked: str, *options: str, remembers: str = "") -> list[str]:
            return [*python, "pytest", "-o", f"cache_dir={memory}/{remembers or 'all'}", "-m", marked, *options]

        workers = len(os.sched_getaffinity(0)) + 1  # one more than processors: some always wait for nodes
        spread = ["-p", "xdist", "-n", str(workers), "--dist=loadfile", "--no-loadscope-reorder"]
        # Only these, as it takes long to collect all.
        texts = {str(file.relative_to(root)): file.read_text("utf-8") for file in sorted(root.glob("tests/**/*.py"))}
        timed = [name for name, text in texts.items() if "mark.timing" in text] or ["tests"]
        patient = [name for name in timed if "mark.beside" in texts.get(name, "")]
        runs, again = [], {}
        with contextlib.ExitStack() as running:
            if patient:
                command = pytest("timing and beside", *patient, remembers="beside")
                beside = running.enter_context(Pytest(command, root, variables, Path(memory, "beside.log")))
                again[beside] = command
            runs.append(Pytest(pytest("not timing", *spread, "tests"), root, variables).finish())
            if patient:
                runs.append(beside.finish())
        command = pytest("timing and not beside" if patient else "timing", *timed, remembers="alone")
        runs.append(Pytest(command, root, variables).finish())
        again[runs[-1]] = command
        for one, command in again.items():
            if one.code == FAILED_TESTS:
                one.repeated = True
                runs.append(Pytest([*command, "--last-failed"], root, variables).finish())
    bad = [one for one in runs if one.code and not one.repeated]
    if failed or bad:
        print("Failed, see above:", *failed, *(one.closing for one in bad), sep="\n  ")
    print(summed([one.counted for one in runs], time.monotonic() - begun), flush=True)
    return max((abs(one.code) for one in bad), default=int(bool(failed)))


def summed(closings: Sequence[str], seconds: float) -> str:
    """One closing line in pytest's manner from several; a run without one is counted as an error."""
    counts: Counter[str] = Counter()
    for closing in closings:
        found = COUNT.findall(closing)
        counts.update({"errors": 1} if not found else {})
        for number, what in found:
            counts[{"error": "errors", "warning": "warnings"}.get(what, what)] += int(number)
    order = ("failed", "passed", "skipped", "xfailed", "xpassed", "repeated", "warnings", "errors")
    told = ", ".join(f"{counts[what]} {what}" for what in order if counts[what])
    return f"=== {told} in {seconds:.2f}s ({int(seconds) // 60} min {int(seconds) % 60} s) ==="


class Pytest:
    """A run of pytest, from its start to its end; `code` and `closing`, its last line, are what it leaves.

    :param aside: file that takes what it says until it is finished: it runs beside another one, and ahead of it
    """

    def __init__(
        self,
        command: Sequence[str],
        folder: Path,
        variables: Mapping[str, str],
        aside: Path | None = None,
        longest: float | None = None,
    ) -> None:
        self.code, self.closing = FAILED_TESTS, ""
        self.repeated = False  # its failures have been run again
        self._title = f"== {' '.join(command[2:])}"
        print(f"{self._title}{'  (told when it has ended)' if aside else ''}", flush=True)
        size = {"COLUMNS": str(shutil.get_terminal_size().columns)}
        colour = ["--color=yes"] if sys.stdout.isatty() else []
        self._aside = aside
        with aside.open("wb") if aside else contextlib.nullcontext(subprocess.PIPE) as sink:
            self._process = subprocess.Popen(
                [*command, *colour], cwd=folder, env={**variables, **size}, stdout=sink, stderr=subprocess.STDOUT
            )
        if aside:
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self._process.pid, AHEAD)
        self._bound = threading.Timer(LONGEST_S if longest is None else longest, self._end)
        self._bound.daemon = True
        self._bound.start()

    def __enter__(self) -> Pytest:
        return self

    def __exit__(self, *_: Any) -> None:
        """Nothing of it goes on."""
        self._bound.cancel()
        if self._process.poll() is None:
            self._end()

    def finish(self) -> Pytest:
        """Show what it says until it has ended."""
        try:
            if self._aside is None:
                self.closing = self._show()
                self.code = self._process.wait()
            else:
                self.code = self._process.wait()
                text = self._aside.read_text("utf-8", "replace")
                print(f"{self._title}\n{text}", flush=True)
                self.closing = last_line(text)
        except BaseException:  # whoever waits for it may be interrupted
            self._end(interrupt=not sys.stdout.isatty())  # on a terminal Ctrl-C reached it as well
            raise
        finally:
            self._bound.cancel()
        return self

    @property
    def counted(self) -> str:
        """Its closing line for the sum: what another run has repeated is counted there."""
        return re.sub(r"\b(\d+) (failed|errors?)\b", r"\1 repeated", self.closing) if self.repeated else self.closing

    def _end(self, interrupt: bool = True) -> None:
        """Let it sum up what it has; end it where it does not."""
        if interrupt:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(INTERRUPT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()

    def _show(self) -> str:
        assert self._process.stdout is not None
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        tail = ""
        while True:
            if not select.select([self._process.stdout], [], [], 1.0)[0]:
                if self._process.poll() is not None:  # what it started and did not end may hold the pipe open
                    break
                continue
            if not (data := os.read(self._process.stdout.fileno(), 65536)):
                break
            text = decoder.decode(data)
            sys.stdout.write(text)
            sys.stdout.flush()
            tail = (tail + text)[-4096:]
        return last_line(tail)


def last_line(text: str) -> str:
    """The last line that is not empty."""
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""
