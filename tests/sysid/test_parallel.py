"""Work on all processors: what a worker hands on is done by others, too, and nobody waits for ever."""

from __future__ import annotations

import threading
import time

import pytest

from hydraulic_sysid.estimation import parallel


@pytest.fixture(autouse=True)
def two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel.processors, "usable", lambda: 2)


def slept(number: int) -> tuple[int, int]:
    time.sleep(0.02)
    return number, threading.get_ident()


def test_a_worker_without_work_helps_the_other() -> None:
    def outer(number: int) -> list[tuple[int, int]]:
        return list(parallel.results(slept, range(20))) if number == 0 else []

    found = next(parallel.results(outer, range(2)))
    assert [number for number, _ in found] == list(range(20))
    assert len({worker for _, worker in found}) == 2


def test_workers_that_all_hand_work_on_come_to_an_end() -> None:
    def inner(number: int) -> int:
        return sum(n for n, _ in parallel.results(slept, range(number)))

    def outer(number: int) -> int:
        return sum(parallel.results(inner, [number, 3, 2]))

    assert list(parallel.results(outer, range(6))) == [sum(sum(range(k)) for k in (n, 3, 2)) for n in range(6)]


def test_what_goes_wrong_in_either_is_raised() -> None:
    def inner(number: int) -> int:
        time.sleep(0.01)
        if number in (0, 9):  # the first is taken by another, the last by the one that hands on
            raise ValueError(f"{number}")
        return number

    def outer(given: range) -> list[int]:
        return list(parallel.results(inner, given))

    for given in (range(9), range(1, 10)):
        with pytest.raises(ValueError, match="0|9"):
            list(parallel.results(outer, [given, range(1, 9)]))
