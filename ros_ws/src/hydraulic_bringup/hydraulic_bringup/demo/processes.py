"""Children of a program: each in a process group of its own, with a log, and none left behind."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from .errors import DemoError

_ESCALATION = ((signal.SIGINT, 5.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 3.0))
_PR_SET_PDEATHSIG = 1
_TAIL = 12  # lines of a log that an error shows

try:
    _LIBC: ctypes.CDLL | None = ctypes.CDLL(None)
except OSError:  # no libc to ask: then only a parent that is killed outright can leave children
    _LIBC = None


def end_with_parent() -> None:
    """In a child, before it starts: end when the thread that started it is killed outright."""
    if _LIBC is not None and hasattr(_LIBC, "prctl"):
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


class Child:
    """One process of the graph; all it prints goes to ``log``. It is told things (`say`) where it ``listens``."""

    def __init__(
        self,
        name: str,
        module: str,
        arguments: Sequence[str],
        log: Path,
        env: Mapping[str, str],
        listens: bool = False,
    ) -> None:
        self.name, self.log = name, log
        self.may_end: tuple[int, ...] = ()  # exit codes that are in order before it is stopped
        with log.open("wb") as sink:
            self._popen = subprocess.Popen(
                [sys.executable, "-m", module, *arguments],
                stdin=subprocess.PIPE if listens else subprocess.DEVNULL,
                stdout=sink,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=end_with_parent,
                env=dict(env),
            )

    @property
    def pid(self) -> int:
        """Process and process group."""
        return self._popen.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        return self._popen.poll()

    def say(self, line: str) -> None:
        """Tell it a line on its standard input.

        :raises OSError: it does not listen any more.
        """
        assert self._popen.stdin is not None
        self._popen.stdin.write(f"{line}\n".encode())
        self._popen.stdin.flush()

    def ending(self) -> str:
        """How it ended, in words."""
        code = self.exit_code
        if code is None:
            return "it still runs"
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"it was killed by {signal.Signals(-code).name}"
        return f"it ended with exit code {code}"

    def tail(self) -> str:
        """The last lines of its log."""
        lines = self.log.read_text(errors="replace").splitlines()[-_TAIL:]
        return "\n".join(f"  | {line}" for line in lines) or "  | (it printed nothing)"

    def alive(self) -> bool:
        """Whether any process of its group is left."""
        self._popen.poll()
        try:
            os.killpg(self.pid, 0)
        except (ProcessLookupError, PermissionError):
            return False
        return True

    def stop(self) -> None:
        """Ask it to end, ever more firmly, until its whole group is gone."""
        for number, patience in _ESCALATION:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.pid, number)
            deadline = time.monotonic() + patience
            while self.alive() and time.monotonic() < deadline:
                time.sleep(0.02)
            if not self.alive():
                return


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Puts off Ctrl-C and SIGTERM: a second one must not leave children behind that the first has not ended yet."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Crew:
    """All children of a run; leaving the ``with`` block stops every one, in reverse order."""

    def __init__(self, logs: Path, env: Mapping[str, str]) -> None:
        self._logs, self._env = logs, env
        self._children: list[Child] = []

    def __enter__(self) -> Crew:
        self._logs.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        with _uninterrupted():
            for child in reversed(self._children):
                child.stop()

    def start(self, name: str, module: str, *arguments: str) -> Child:
        """Start ``python -m module arguments``."""
        child = Child(name, module, arguments, self._logs / f"{name}.log", self._env)
        self._children.append(child)
        return child

    def check(self, step: str) -> None:
        """See whether all is well with the children.

        :raises DemoError: one has ended that should run, or has ended badly.
        """
        for child in self._children:
            code = child.exit_code
            if code is not None and code not in child.may_end:
                why = f"process {child.name}: {child.ending()}; its last words:\n{child.tail()}"
                raise DemoError(step, why, f"log: {child.log}")

    def wait(
        self,
        condition: Callable[[], object],
        step: str,
        patience: float,
        tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Until ``condition`` is true.

        :raises DemoError: a child fails meanwhile, or it takes too long.
        """
        deadline = time.monotonic() + patience
        while not condition():
            self.check(step)
            if time.monotonic() > deadline:
                heads = "\n".join(f"{c.name}:\n{c.tail()}" for c in self._children if c.exit_code is None)
                raise DemoError(step, f"waited {patience:g} s in vain\n{heads}", f"logs: {self._logs}")
            tick()
            time.sleep(0.05)
