"""The driver against scripted frames: what it puts on the wire, byte for byte, and what it makes of what comes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.cia408 import State


def test_boot_start_drive_and_stop(bench: Bench, wire: Any, loop_of: Callable[..., Any], wait_until: Any) -> None:
    bench.boot()
    bench.start()
    loop = loop_of(bench)
    bench.follow(State.ACTIVE)
    loop.drive = 5.0
    wait_until(lambda: (0x510, bytes.fromhex("0700 0020")) in wire.log, "5 V on the wire")
    loop.drive = -10.0
    wait_until(lambda: (0x510, bytes.fromhex("0700 00c0")) in wire.log, "-10 V on the wire")
    wait_until(lambda: loop.samples[-1].drive == -10.0, "a sample with the drive")
    sample = loop.samples[-1]
    assert sample.position == pytest.approx(0.0, abs=1e-12) and sample.spool == pytest.approx(-0.5e-3)
    assert (sample.pressure_a, sample.pressure_b, sample.pressure_supply) == (7e6, 7e6, 14e6)
    loop.end()
    words = [data[0] for _, data in wire.sent(0x510)]
    steps = [word for word, before in zip(words, [-1, *words], strict=False) if word != before]
    assert steps == [0, 1, 3, 7, 1, 0]
    assert wire.log[-1][0] != 0x510 and wire.sent(0x510)[-1] == (0x510, bytes(4))
