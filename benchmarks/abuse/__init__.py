"""What strangers may send, and what must hold whatever they send: targets for `benchmarks/fuzz.py`.

A target is a function ``(rng, folder) -> int``: it feeds one batch of random things to a part of the bench and gives
their number. It raises `BrokenError` where something is not as it must be; any other exception is a finding, too. All
that is random comes from ``rng``, so that a batch can be repeated from its seed.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

Target = Callable[[random.Random, Path], int]


class BrokenError(AssertionError):
    """Something that must hold does not."""


def must(holds: object, what: str) -> None:
    """Raise `BrokenError` unless it holds."""
    if not holds:
        raise BrokenError(what)


def run_batch(target: Target, name: str, seed: int, batch: int, folder: Path) -> int:
    """One batch of a target, the same for the same seed and number; how many things it has sent."""
    return target(random.Random(f"{seed}/{name}/{batch}"), folder)
