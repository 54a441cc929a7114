"""A design as a result document: plans, predictions, limits, and what the model does under each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.display import number, quantity
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.excitation.amplitude import Limits, Sized
from hydraulic_sysid.excitation.crest import crest_factor

_SHOWN = ("drive", "position", "velocity", "pressure_a", "pressure_b")
_LINES = 400


def document(
    sized: Sequence[Sized], files: Sequence[str], bandwidth: float | None, band: tuple[float, float], limits: Limits
) -> dict[str, Any]:
    """The result document of plans (realisations of one signal) and the files that hold them."""
    first = sized[0].plan
    assert first.prediction is not None
    named = first.description.partition(",")[0]
    part = f" ({number(band[0] / bandwidth)} … {number(band[1] / bandwidth)} times the bandwidth)" if bandwidth else ""
    text = (
        f"{named[:1].upper()}{named[1:]} from {number(band[0])} to {number(band[1])} Hz{part}, "
        f"{quantity(first.prediction.drive_peak, 'V')} at its peak; {first.prediction.limited_by} allows no more."
    )
    periods = first.active_time * band[0]
    if periods < 1.0:
        text += f" Its {first.active_time:g} s hold {number(periods)} periods of the lowest frequency: play it longer."
    return {
        **heading("design"),
        "verdict": {"level": "explained", "text": text},
        "title": f"Excitation design for {first.prediction.model}",
        "model": {"name": first.prediction.model},
        "signal": named,
        "bandwidth": bandwidth,
        "band": list(band),
        "limits": asdict(limits),
        "plans": [_plan(one, file) for one, file in zip(sized, files, strict=True)],
    }


def _plan(one: Sized, file: str) -> dict[str, Any]:
    plan, record = one.plan, one.simulated.record
    assert plan.prediction is not None
    active = plan.open_loop[plan.envelope > 0.0]
    return {
        "name": plan.name,
        "file": file,
        "plan": {k: v for k, v in plan.as_mapping().items() if k != "prediction"},
        "prediction": plan.prediction.as_mapping(),
        "rms": float(np.sqrt(np.mean(active**2))),
        "crest_factor": crest_factor(active),
        "spectrum": _spectrum(active, 1.0 / plan.rate),
        "traces": {name: trace(record.time, record[name]) for name in _SHOWN},
    }


def _spectrum(drive: np.ndarray, dt: float) -> dict[str, Any]:
    """Amplitudes [V] of the drive's lines, the strongest of each of up to 400 bands of equal ratio."""
    amplitude = 2.0 / drive.size * np.abs(np.fft.rfft(drive))[1:]
    frequency = np.arange(1, amplitude.size + 1) / (drive.size * dt)
    edges = np.unique(np.geomspace(1, amplitude.size, _LINES).astype(int))
    starts = edges - 1
    best = np.maximum.reduceat(amplitude, starts)
    return {"frequency": frequency[starts], "amplitude": best}
