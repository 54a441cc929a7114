"""The part of the result document that belongs to one record."""

from __future__ import annotations

from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.decimation import trace

from .reference_run import MODES, Compared
from .spectra import amplitude_density, noise_density


def record_document(c: Compared) -> dict[str, Any]:
    """Figures, traces for plots, spectra and error growth of one record."""
    record, data = c.data.record, c.data
    document: dict[str, Any] = {
        "name": record.name,
        "source": str(record.source),
        "sampling_time": record.dt,
        "samples": len(record),
        "duration": record.duration,
        "description": record.description,
        "velocity_filter_window": data.velocity_filter.window,
        "channels": {},
        "drive": trace(record.time, record["drive"]),
        "traces": {},
        "spectra": {},
        "error_growth": {"lead_time": c.runs.growth_lead},
    }
    for name in data.compared:
        document["channels"][name] = {"noise_std": data.noise[name], **{mode: figures(c, mode, name) for mode in MODES}}
        document["traces"][name] = _traces(c, name)
        document["spectra"][name] = _spectra(c, name)
        document["error_growth"][name] = {
            "rms": c.runs.growth_rms[name],
            "exact_rms": c.reference_runs.growth_rms[name],
        }
    return document


def figures(c: Compared, mode: str, channel: str) -> dict[str, float]:
    """Errors of one channel in one mode; ``exact_rmse`` is what an exact model would show at this noise."""
    error, exact = c.error(mode, channel), c.exact_error(mode, channel)
    keep = np.isfinite(error)
    error, y = error[keep], c.data.channels[channel][keep]
    spread = float(np.linalg.norm(y - y.mean()))
    found = {
        "rmse": float(np.sqrt(np.mean(error**2))),
        "exact_rmse": float(np.sqrt(np.mean(exact[keep] ** 2))),
        "nrmse": float(np.linalg.norm(error)) / spread if spread > 0.0 else float("nan"),
        "bias": float(error.mean()),
        "largest": float(np.abs(error).max()),
        "std": spread / np.sqrt(y.size),
        "samples": int(y.size),
    }
    if mode == "free_run":
        found["drift"], left = _detrended(c.data.record.time[keep], error)
        found["rmse_detrended"] = float(np.sqrt(np.mean(left**2)))
        found["nrmse_detrended"] = float(np.linalg.norm(left)) / spread if spread > 0.0 else float("nan")
    return found


def _detrended(time: Array, error: Array) -> tuple[float, Array]:
    """Slope of the straight line through an error, and the error without it."""
    line = np.polyfit(time, error, 1)
    return float(line[0]), error - np.polyval(line, time)


def _traces(c: Compared, name: str) -> dict[str, Any]:
    time = c.data.record.time
    traces = {"measured": trace(time, c.data.channels[name])}
    for mode in ("free_run", "horizon"):
        traces[mode] = trace(time, getattr(c.runs, mode)[name])
        traces[f"{mode}_error"] = trace(time, c.error(mode, name))
    return traces


def _spectra(c: Compared, name: str) -> dict[str, Array]:
    """Amplitude densities; the free run's error without its straight drift, which would leak over all bands."""
    dt, data = c.data.record.dt, c.data
    frequency, signal = amplitude_density(data.channels[name], dt)
    _, free = _detrended(data.record.time, c.error("free_run", name))
    derivative = data.velocity_filter if name == "velocity" else None
    sigma = data.noise["position" if derivative else name]
    return {
        "frequency": frequency,
        "measured": signal,
        "free_run_error": amplitude_density(free, dt)[1],
        "noise": noise_density(frequency, sigma, dt, derivative),
    }
