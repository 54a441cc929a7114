"""Ctrl-C while a result is written."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from hydraulic_node_utils.interrupts import finishing


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


def test_the_first_changes_nothing_and_the_second_ends_it() -> None:
    written = []
    with finishing():
        interrupt()
        written.append("result")
    with pytest.raises(KeyboardInterrupt), finishing():
        interrupt()
        written.append("page")
        interrupt()
        written.append("more")
    assert written == ["result", "page"]
    with pytest.raises(KeyboardInterrupt):  # as before it
        interrupt()


def test_it_leaves_alone_who_handles_it_otherwise() -> None:
    taken = []
    before = signal.signal(signal.SIGINT, lambda number, _: taken.append(number))
    try:
        with finishing():
            interrupt()
            interrupt()
    finally:
        signal.signal(signal.SIGINT, before)
    assert taken == [signal.SIGINT] * 2


def test_another_thread_goes_on_without() -> None:
    done = threading.Event()

    def work() -> None:
        with finishing():
            done.set()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done.is_set()
