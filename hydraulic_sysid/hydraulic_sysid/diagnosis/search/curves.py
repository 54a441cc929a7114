"""The pieces on which a model was worst, as measured and as the model has them before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from .pieces import Split
from .search import Stage

MOST = 4


def curves(split: Split, before: Stage, after: Stage) -> list[dict[str, Any]]:
    """Held-out pieces (fitted ones where none are) with the largest residual before, one per record at most."""
    found = []
    for i, (pieces, chosen) in enumerate(zip(split.pieces, split.fitted, strict=True)):
        usable = np.flatnonzero(~chosen) if (~chosen).any() else np.arange(len(chosen))
        worst = int(usable[np.argmax(before.anchor.costs[i][usable])])
        found.append((float(before.anchor.costs[i][worst] / pieces.samples), i, worst))
    rows = []
    for _, i, k in sorted(found, reverse=True)[:MOST]:
        pieces = split.pieces[i]
        shape = (pieces.samples, len(pieces.channels))
        measured = pieces.measured[k] * pieces.noise
        start = int(pieces.starts[k])
        rows.append(
            {
                "record": pieces.record.name,
                "role": "fit" if split.fitted[i][k] else "validation",
                "time": (start + np.arange(pieces.samples)) * pieces.record.dt,
                "drive": pieces.record["drive"][start : start + pieces.samples],
                "channels": {
                    c: {
                        "noise_std": float(pieces.noise[j]),
                        "measured": measured[:, j],
                        "before": measured[:, j] - _residual(before, i, k, shape)[:, j] * pieces.noise[j],
                        "after": measured[:, j] - _residual(after, i, k, shape)[:, j] * pieces.noise[j],
                    }
                    for j, c in enumerate(pieces.channels)
                },
            }
        )
    return rows


def _residual(stage: Stage, record: int, piece: int, shape: tuple[int, int]) -> np.ndarray:
    return stage.residual[record][piece, : shape[0] * shape[1]].reshape(shape)
