"""Runs the commands of the set-up: the user sees what runs and for how long, the output goes to a log."""

from __future__ import annotations

import contextlib
import os
import re
import selectors
import shutil
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TextIO

from .errors import BenchError

REFRESH_S = 0.2
QUIET_S = 10.0  # a log file or a CI console gets one line in so many seconds
TAIL_LINES = 12


class Progress:
    """One line on the terminal for a running step: title, elapsed time, what it is at."""

    def __init__(self, title: str, stream: TextIO | None = None) -> None:
        self.title = title
        self.detail = ""
        self._stream = stream if stream is not None else sys.stderr
        self._live = self._stream.isatty()
        self._start = time.monotonic()
        self._shown = self._start
        if not self._live:
            self._print(f"{title} ...")

    @property
    def elapsed(self) -> float:
        """Seconds since the step began."""
        return time.monotonic() - self._start

    def refresh(self) -> None:
        """Show that the step is alive."""
        now = time.monotonic()
        if self._live:
            width = shutil.get_terminal_size().columns - 1
            text = f"{self.title}  {self.elapsed:3.0f} s  {self.detail}"
            self._stream.write(f"\r\033[K{text[:width]}")
            self._stream.flush()
        elif now - self._shown >= QUIET_S:
            self._shown = now
            self._print(f"  {self.elapsed:3.0f} s  {self.detail}")

    def close(self, outcome: str) -> None:
        """End the line with `outcome` and the time taken."""
        clear = "\r\033[K" if self._live else ""
        self._print(f"{clear}{self.title}: {outcome} ({self.elapsed:.1f} s)")

    def _print(self, text: str) -> None:
        with contextlib.suppress(BrokenPipeError):
            print(text, file=self._stream, flush=True)


def run_step(
    title: str,
    command: Sequence[str | Path],
    *,
    log: Path,
    environ: Mapping[str, str],
    cwd: Path,
    remedy: str,
    describe: Callable[[str], str | None] = lambda line: None,
    keep_open: Sequence[int] = (),
) -> None:
    """Run `command` to its end, with progress on stderr and its output in `log`.

    :param describe: makes the text behind the elapsed time out of a line of output, or None to leave it
    :param keep_open: file descriptors the command inherits (the lock: it lasts as long as the command)
    :raises BenchError: the command failed; with the end of its output and `remedy`
    """
    log.parent.mkdir(parents=True, exist_ok=True)
    progress = Progress(title)
    with log.open("wb") as sink:
        sink.write(f"$ {' '.join(map(str, command))}\n".encode())
        process = _start(command, environ, cwd, keep_open)
        tail: deque[str] = deque(maxlen=200)
        try:
            _follow(process, sink.write, tail, progress, describe)
        except BaseException:
            progress.close("stopped")
            _stop(process)
            raise
    if process.returncode:
        progress.close("failed")
        raise BenchError(
            f"{title}: failed with exit code {process.returncode}.",
            why="\n".join(telling_lines(list(tail))),
            remedy=f"{remedy}\nThe whole output: {log}",
        )
    progress.close("done")


def telling_lines(output: list[str]) -> list[str]:
    """The lines of a failed command's output that say why.

    Those pip marks as errors, with its last reason for trying again; else the end of the first traceback,
    with colcon's line about the package; else the last ones.
    """
    lines = [line[:300] for line in output if line.strip()]
    told = [line for line in lines if line.startswith("ERROR")]
    told[:0] = [line for line in lines if line.startswith("WARNING: Retrying")][-1:]
    if not told:
        raised = next((n for n, line in enumerate(lines) if re.match(r"[\w.]+(Error|Exception)\b", line)), None)
        if raised is not None:
            told = [line for line in lines if re.match(r"Failed\s+<<<", line)]
            told += lines[max(0, raised - 5) : raised + 1]
    return (told or lines)[-TAIL_LINES:]


def _start(
    command: Sequence[str | Path], environ: Mapping[str, str], cwd: Path, keep_open: Sequence[int]
) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            [str(part) for part in command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=dict(environ),
            cwd=cwd,
            pass_fds=tuple(keep_open),
            start_new_session=True,  # Ctrl-C reaches the command through _stop, with all its children
        )
    except OSError as error:
        raise BenchError(f"Cannot start {command[0]}.", why=str(error)) from error


def _follow(
    process: subprocess.Popen[bytes],
    write: Callable[[bytes], object],
    tail: deque[str],
    progress: Progress,
    describe: Callable[[str], str | None],
) -> None:
    assert process.stdout is not None
    pending = b""
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while True:
            progress.refresh()
            if not selector.select(REFRESH_S):
                continue
            chunk = os.read(process.stdout.fileno(), 65536)
            if not chunk:
                break
            write(chunk)
            *complete, pending = (pending + chunk).split(b"\n")
            for line in (raw.decode(errors="replace").rstrip() for raw in complete):
                tail.append(line)
                progress.detail = describe(line) or progress.detail
    tail.append(pending.decode(errors="replace"))
    process.wait()


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End the command and its children: politely, then not."""
    for how, patience in ((signal.SIGINT, 3.0), (signal.SIGTERM, 2.0), (signal.SIGKILL, 2.0)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, how)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            break
    # A child that was only starting may have lost the signal, and would outlive the command.
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
