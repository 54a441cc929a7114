"""A small part of `benchmarks/fuzz.py`, the same each time: strangers' messages, frames and files, no processes."""

from __future__ import annotations

from pathlib import Path

import pytest

import fuzz

FEW = {"commands": 4000, "references": 500, "parameters": 1000, "frames": 4000, "csv files": 50}
"""How much is sent of what costs little; of the rest it is a batch."""


@pytest.mark.parametrize("target", [name for name in fuzz.TARGETS if name not in ("reports", "graph")])
def test_nothing_that_strangers_send_breaks_anything(target: str) -> None:
    sent, findings = fuzz.fuzz(target, FEW.get(target, 1), seed=1)
    assert not findings, findings
    assert sent >= FEW.get(target, 1)


def test_a_finding_is_told_with_what_repeats_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(rng: object, folder: Path) -> int:
        raise KeyError("oops")

    monkeypatch.setitem(fuzz.TARGETS, "gains", (broken, 1.0))
    sent, findings = fuzz.fuzz("gains", 1, seed=7, only=3)
    assert sent == 0 and "--target 'gains' --seed 7 --batch 3: " in findings[0] and "oops" in findings[0]
