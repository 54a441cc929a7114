"""Excitation plans as the page shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.excitation import load_plan


def describe(file: Path) -> dict[str, Any]:
    """Name, signal, length, largest drive, travel."""
    plan = load_plan(file)
    return plain(
        {
            "name": plan.name,
            "description": plan.description,
            "signal": plan.signal.label,
            "seconds": plan.total_time,
            "amplitude": float(abs(plan.open_loop).max()),
            "amplitude_limit": plan.amplitude_limit,
            "travel_limit": plan.travel_limit,
            "centre": plan.centre,
            "approach": plan.approach,
            "rate": plan.rate,
        }
    )


def whole(file: Path) -> dict[str, Any]:
    """A plan with its text and its drive without centring."""
    plan = load_plan(file)
    return {**describe(file), "text": file.read_text("utf-8"), **plain(trace_of(plan))}


def trace_of(plan: Any) -> dict[str, Any]:
    """Time and drive of a plan, few points."""
    drive = trace(plan.time, plan.open_loop)
    return {"time": drive["time"], "drive": drive["value"]}
