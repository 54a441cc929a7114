"""Figures of a step as both verbs show them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

STEP_COLUMNS = (">|Tr s", ">|Ts s", ">|OS %", ">|error µm")


def step_cells(figures: Mapping[str, Any] | None) -> list[str]:
    """Cells under `STEP_COLUMNS`; None is a plant that ran away."""
    if figures is None:
        return ["runs away", "", "", ""]
    f = figures
    times = [f"{f['rise_time']:.3f}", f"{f['settling_time']:.3f}"]
    return [*times, f"{f['overshoot']:.2f}", f"{1e6 * f['steady_state_error']:.1f}"]


def finite(value: Any) -> Any:
    """The same in JSON's own types: what is not finite becomes null."""
    if isinstance(value, dict):
        return {key: finite(v) for key, v in value.items()}
    if isinstance(value, list):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
