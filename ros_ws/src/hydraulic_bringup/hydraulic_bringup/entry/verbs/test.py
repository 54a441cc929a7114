"""test [--thorough | PYTEST ARG …]: build, ruff, mypy and the tests; with arguments only pytest on those.

Without --thorough, tests that take long (marker `thorough`) are left out. The tests fill all processors; those of the
wall clock (marker `timing`) run after all others, one after the other, and only they are repeated, once, where they
fail. The last line printed is the sum of pytest's closing lines. Exit code 0 only if everything passed.
"""

from __future__ import annotations

import codecs
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

from ..bench import Bench

ORDER = 2
CHECKS = ("ruff", "check", "."), ("mypy",)
COMPILE = (
    "from hydraulic_sim import model_file, plant; plant.Plant(model_file.load_model('sample_bench')); "
    "import pytest; pytest.main(['--collect-only', '-qqq', 'tests'])"
)
FAILED_TESTS = 1  # pytest's exit code; others mean that it was not able to run them
THOROUGH = "--thorough"
LONGEST_S = 2400.0  # of a run on two processors, with a margin; what hangs beyond it is interrupted and has failed
LONGEST_THOROUGH_S = 7200.0
INTERRUPT_S = 15.0  # for pytest to end its node processes and to sum up
COUNT = re.compile(r"(\d+) (passed|failed|errors?|skipped|xfailed|xpassed|repeated|warnings?)\b")


def run(bench: Bench, arguments: list[str]) -> int:
    """Set up what is missing, then check the sources and run the tests."""
    if arguments in (["-h"], ["--help"]):
        print(f"usage: ./bench {__doc__}")
        return 0
    thorough = arguments == [THOROUGH]
    bench.prepare()
    root, variables = bench.checkout.root, bench.variables()
    python = [str(bench.checkout.python), "-m"]
    if arguments and not thorough:
        here = Path.cwd() if root in Path.cwd().parents else root  # so that given paths mean what they say
        return Pytest([*python, "pytest", *arguments], here, variables, longest=threading.TIMEOUT_MAX).code
    variables.pop("PYTHONDONTWRITEBYTECODE", None)  # each of hundreds of processes would compile all that it imports
    failed = []
    # Once, and beside the checks: else each of the workers would begin with it. The tests say what is wrong with it.
    with subprocess.Popen([python[0], "-c", COMPILE], cwd=root, env=variables, stdout=subprocess.DEVNULL):
        for name, *options in CHECKS:
            print(f"== {name}", flush=True)
            if subprocess.call([*python, name, *options], cwd=root, env=variables):
                failed.append(name)
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="bench_test_") as memory:
        pytest = [*python, "pytest", "-o", f"cache_dir={memory}", "-m"]
        workers = len(os.sched_getaffinity(0)) + 1  # one more than processors: some always wait for nodes
        spread = ["-p", "xdist", "-n", str(workers), "--dist=loadfile", "--no-loadscope-reorder"]
        # Only these, as it takes long to collect all.
        files = sorted(root.glob("tests/**/*.py"))
        timed = [str(file.relative_to(root)) for file in files if "mark.timing" in file.read_text("utf-8")] or ["tests"]
        chosen = "not timing" if thorough else "not timing and not thorough"
        longest = LONGEST_THOROUGH_S if thorough else None
        runs = [
            Pytest([*pytest, chosen, *spread, "tests"], root, variables, longest),
            Pytest([*pytest, "timing", *timed], root, variables),
        ]
        if runs[-1].code == FAILED_TESTS:
            runs[-1].repeated = True
            runs.append(Pytest([*pytest, "timing", *timed, "--last-failed"], root, variables))
    if not thorough:
        print(f"Left out, since they take long: the tests marked thorough (./bench test {THOROUGH}).")
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
    """A run of pytest, shown as it goes and ended; `code` and `closing`, its last line, are what it left."""

    def __init__(
        self, command: Sequence[str], folder: Path, variables: Mapping[str, str], longest: float | None = None
    ) -> None:
        self.repeated = False  # its failures have been run again
        print(f"== {' '.join(command[2:])}", flush=True)
        size = {"COLUMNS": str(shutil.get_terminal_size().columns)}
        colour = ["--color=yes"] if sys.stdout.isatty() else []
        process = subprocess.Popen(
            [*command, *colour], cwd=folder, env={**variables, **size}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        bound = threading.Timer(LONGEST_S if longest is None else longest, self._end, [process])
        bound.daemon = True
        bound.start()
        try:
            self.closing = self._show(process)
            self.code = process.wait()
        except BaseException:  # whoever waits for it may be interrupted
            self._end(process, interrupt=not sys.stdout.isatty())  # on a terminal Ctrl-C reached it as well
            raise
        finally:
            bound.cancel()

    @property
    def counted(self) -> str:
        """Its closing line for the sum: what another run has repeated is counted there."""
        return re.sub(r"\b(\d+) (failed|errors?)\b", r"\1 repeated", self.closing) if self.repeated else self.closing

    @staticmethod
    def _end(process: subprocess.Popen[bytes], interrupt: bool = True) -> None:
        """Let it sum up what it has; end it where it does not."""
        if interrupt:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(INTERRUPT_S)
        except subprocess.TimeoutExpired:
            process.kill()

    @staticmethod
    def _show(process: subprocess.Popen[bytes]) -> str:
        assert process.stdout is not None
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        tail = ""
        while True:
            if not select.select([process.stdout], [], [], 1.0)[0]:
                if process.poll() is not None:  # what it started and did not end may hold the pipe open
                    break
                continue
            if not (data := os.read(process.stdout.fileno(), 65536)):
                break
            text = decoder.decode(data)
            sys.stdout.write(text)
            sys.stdout.flush()
            tail = (tail + text)[-4096:]
        lines = [line for line in tail.splitlines() if line.strip()]
        return lines[-1] if lines else ""
