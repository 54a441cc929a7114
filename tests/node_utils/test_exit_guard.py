"""A process that hangs in C with the interpreter's lock held still leaves, with its exit code."""

from __future__ import annotations

import subprocess
import sys

import pytest

GUARDED = "from hydraulic_node_utils.nodes.exit_guard import exit_guard\nwith exit_guard({code}, 0.2):"
# PyDLL keeps the interpreter's lock during the call, as rclpy does while it destroys a node.
HANG = "    import ctypes, threading; threading.Thread(target=lambda: None).start(); ctypes.PyDLL(None).sem_wait(s)"
SEMAPHORE = "import ctypes; s = ctypes.create_string_buffer(64); ctypes.CDLL(None).sem_init(s, 0, 0)"


def run(*lines: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, timeout=500, check=False
    )


@pytest.fixture(autouse=True)
def _same_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", ":".join(path for path in sys.path if path))


@pytest.mark.parametrize("code", [0, 1])
def test_a_hanging_process_leaves_with_its_code(code: int) -> None:
    ended = run(SEMAPHORE, "print('last words')", GUARDED.format(code=code), HANG)
    assert (ended.returncode, ended.stdout) == (code, "last words\n"), ended.stderr
    assert "leaving without it" in ended.stderr


def test_a_process_that_gets_away_in_time_is_not_disturbed() -> None:
    ended = run(GUARDED.format(code=1), "    pass", "import time; time.sleep(0.5)", "raise SystemExit(7)")
    assert (ended.returncode, ended.stderr) == (7, "")


def test_the_handler_that_was_there_is_put_back() -> None:
    before = "import signal; signal.signal(signal.SIGALRM, lambda *_: print('mine'))"
    ended = run(before, GUARDED.format(code=1), "    pass", "signal.raise_signal(signal.SIGALRM)")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "mine\n", "")
