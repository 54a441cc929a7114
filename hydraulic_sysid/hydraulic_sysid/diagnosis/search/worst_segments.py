"""The segments on which a model was worst, as measured and as the model has them before and after."""

from __future__ import annotations

from typing import Any

import numpy as np

from .search_state import SearchResult

MOST = 4


def worst_segments(result: SearchResult) -> list[dict[str, Any]]:
    """Segments for validation (fitted ones where none are) with the largest residual before, one per record at most."""
    found = []
    for i, (segments, fit) in enumerate(zip(result.split.segments, result.split.fit, strict=True)):
        costs = result.base.linearisation.costs[i]
        usable = np.flatnonzero(~fit) if (~fit).any() else np.arange(len(segments))
        worst = int(usable[np.argmax(costs[usable])])
        found.append((float(costs[worst] / segments.samples), i, worst))
    rows = []
    for _, i, k in sorted(found, reverse=True)[:MOST]:
        segments = result.split.segments[i]
        measured = segments.measured[k]
        before, after = (
            measured - segments.in_units(np.asarray(state.residual[i]))[k] for state in (result.base, result.final)
        )
        index = int(segments.first[k]) + np.arange(segments.samples)
        rows.append(
            {
                "record": segments.record.name,
                "role": "fit" if result.split.fit[i][k] else "validation",
                "time": index * segments.record.dt,
                "drive": segments.record["drive"][index],
                "channels": {
                    c: {
                        "noise_std": float(segments.noise_std[j]),
                        "measured": measured[:, j],
                        "before": before[:, j],
                        "after": after[:, j],
                    }
                    for j, c in enumerate(segments.channels)
                },
            }
        )
    return rows
