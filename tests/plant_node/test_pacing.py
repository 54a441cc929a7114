"""How long a pacer spins follows from how late sleeps end."""

from __future__ import annotations

import time

import pytest

from hydraulic_plant_node import pacing
from hydraulic_plant_node.pacing import Pacer


class Clock:
    """Time that passes when it is slept away or read; a sleep ends ``late`` [ns]."""

    def __init__(self) -> None:
        self.now, self.late = 0, 0

    def monotonic_ns(self) -> int:
        self.now += 100
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9) + self.late


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time, "monotonic_ns", made.monotonic_ns)
    monkeypatch.setattr(time, "sleep", made.sleep)
    return made


def lateness(pacer: Pacer, clock: Clock, cycles: int) -> int:
    """Of the last of some cycles of 1 ms [ns]."""
    late = 0
    for _ in range(cycles):
        due = clock.now + 1_000_000
        late = pacer.wait(due) - due
    return late


def test_the_spin_grows_until_it_hides_how_late_sleeps_end_and_shrinks_again(clock: Clock) -> None:
    pacer = Pacer()
    assert lateness(pacer, clock, 3) < 1000
    clock.late = 180_000
    assert lateness(pacer, clock, 1) > 50_000
    assert lateness(pacer, clock, 20) < 1000
    clock.late = 0
    lateness(pacer, clock, 5000)
    clock.late = 180_000
    assert lateness(pacer, clock, 1) > 50_000, "it spins no longer than it has to"


def test_the_spin_has_an_end(clock: Clock) -> None:
    pacer, clock.late = Pacer(), 600_000
    late = lateness(pacer, clock, 100)
    assert late > 600_000 - pacing._MOST_SPIN_NS - 1000
