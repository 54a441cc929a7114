"""Frequency responses of records as a result document, and what they say about the plant's linearity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array, Complex
from hydraulic_sysid.data.display import number
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.linear.errors import FrequencyResponseError

from .bla import BestLinearApproximation, Lines, best_linear_approximation
from .periodic import Periods, periodic_signal, periods_of
from .spectral import Spectral, etfe, welch

METHODS = ("auto", "bla", "welch")
_SEGMENTS = 8.0
_SMOOTHED = 20.0  # lines over which the empirical estimate is smoothed
_POINTS = 600
_LINEAR_DB, _CLOSE_DB = -40.0, -20.0


def respond(
    records: Sequence[Record],
    *,
    method: str = "auto",
    input: str = "drive",
    output: str = "position",
    period: float | None = None,
    start: float = 0.0,
    segment: float | None = None,
    width: float | None = None,
) -> dict[str, Any]:
    """Result document: best linear approximation of periodic records, Welch's and the empirical estimate of others.

    Several records of one period and one set of lines are realisations; of others only one at a time is taken.
    ``segment`` [s] and ``width`` [Hz] follow from the record unless given.

    :raises FrequencyResponseError: no record, a channel missing, no whole periods, too short.
    """
    if not records:
        raise FrequencyResponseError("there is no record")
    for record in records:
        record.require(input, output, error=FrequencyResponseError)
    if method == "auto":
        method = "bla" if period is not None or all(periodic_signal(r) is not None for r in records) else "welch"
    if method == "welch" and len(records) > 1:
        raise FrequencyResponseError(f"{len(records)} records: without periods one record is taken at a time")
    first = records[0]
    content: dict[str, Any] = {"lines": None, "odd_lines": None, "even_lines": None, "levels_db": None}
    if method == "bla":
        cut = [periods_of(r, output, input, period, start) for r in records]
        content |= _periodic(cut, output == "position")
    content |= _spectral(first, input, output, segment, width)
    text, level = _verdict(content, method)
    return {
        **heading("frequency_response", 2),
        "verdict": {"level": level, "text": text},
        "title": f"Frequency response of {first.name}",
        "model": {"name": ", ".join(r.name for r in records)},
        "method": method,
        "settings": {
            "input": {"channel": input, "unit": first.unit(input)},
            "output": {"channel": output, "unit": first.unit(output)},
        },
        "records": [
            {"name": r.name, "source": str(r.source), "duration": r.duration, "sampling_time": r.dt} for r in records
        ],
        **content,
    }


def _periodic(cut: Sequence[Periods], integrating: bool) -> dict[str, Any]:
    found = best_linear_approximation(cut)
    # In the velocity of an integrating plant: in its position the lowest lines would be all that counts.
    weigh = np.square if integrating else np.ones_like
    levels = {
        "odd_distortion": _level(found.odd, found, weigh),
        "even_distortion": _level(found.even, found, weigh),
        "nonlinear_between_realisations": _between(found, weigh(found.frequency)),
        "noise": _ratio(found.output_noise**2, found.output**2, weigh(found.frequency)),
    }
    drive = np.concatenate([p.drive.ravel() for p in cut])
    return {
        "realisations": found.realisations,
        "periods": found.periods,
        "drive_rms": float(np.std(drive)),
        "lines": {
            "frequency": found.frequency,
            **_curve(found.response),
            "noise_std": found.noise,
            "total_std": found.total,
            "distortion": found.distortion,
            "coherence": found.coherence,
            "output": found.output,
            "output_noise_std": found.output_noise,
        },
        "odd_lines": _lines(found.odd),
        "even_lines": _lines(found.even),
        "levels_db": levels,
        "linear_fit_limit": _linear_fit_limit(found, levels),
    }


def _lines(lines: Lines | None) -> dict[str, Any] | None:
    if lines is None:
        return None
    return {"frequency": lines.frequency, "amplitude": lines.amplitude, "noise_std": lines.noise}


def _curve(response: Complex) -> dict[str, Any]:
    return {"magnitude": np.abs(response), "phase": np.unwrap(np.angle(response))}


def _level(lines: Lines | None, found: BestLinearApproximation, weigh: Callable[[Array], Array]) -> float | None:
    """Power at the detection lines over that of the linear output beside them, noise taken off [dB].

    None where there are no such lines, or no more than noise on them.
    """
    if lines is None:
        return None
    beside = np.interp(lines.frequency, found.frequency, found.output**2)
    return _ratio(lines.amplitude**2 - lines.noise**2, beside, weigh(lines.frequency))


def _between(found: BestLinearApproximation, weight: Array) -> float | None:
    distortion = found.distortion
    if distortion is None:
        return None
    return _ratio((distortion / np.abs(found.response) * found.output) ** 2, found.output**2, weight)


def _ratio(power: Array, reference: Array, weight: Array) -> float | None:
    share = float(np.sum(weight * power) / np.sum(weight * reference))
    return 10.0 * float(np.log10(share)) if share > 0.0 else None


def _linear_fit_limit(found: BestLinearApproximation, levels: dict[str, float | None]) -> float | None:
    """Best fit [%] that a linear model can reach on the played lines and those beside them.

    It is what of the output's amplitude is neither distortion nor noise; None where distortion was not measured.
    """
    played = float(np.sum(found.output**2))
    if found.odd is not None and found.even is not None:
        # On the lines that are played lies as much odd distortion as on the odd lines beside them.
        beside = float(np.sum(found.odd.amplitude**2) + np.sum(found.even.amplitude**2))
        wrong = float(np.sum(np.interp(found.frequency, found.odd.frequency, found.odd.amplitude**2))) + beside
        return 100.0 * (1.0 - float(np.sqrt(wrong / (played + beside))))
    if found.distortion is None:
        return None
    wrong = float(np.sum((found.distortion / np.abs(found.response) * found.output) ** 2 + found.output_noise**2))
    return 100.0 * (1.0 - float(np.sqrt(wrong / played)))


def _spectral(record: Record, input: str, output: str, segment: float | None, width: float | None) -> dict[str, Any]:
    """Welch's and the empirical estimate of a record; a position is taken to be that of an integrating plant."""
    u, y, dt = record[input], record[output], record.dt
    integrating = output == "position"
    segment = segment or max(round(record.duration / _SEGMENTS / dt), 16) * dt
    width = width or _SMOOTHED / record.duration
    by_segments = welch(u, y, dt, segment, integrating=integrating)
    whole = etfe(u, y, dt, width, integrating=integrating)
    return {
        "welch": {"segment": segment, "averages": by_segments.averages, **_estimate(by_segments)},
        "etfe": {"width": width, **_estimate(whole)},
    }


def _estimate(found: Spectral) -> dict[str, Any]:
    """At most 600 of the lines that the drive reaches, evenly over the logarithm of the frequency."""
    keep = np.unique(np.geomspace(1, found.frequency.size, _POINTS).astype(int)) - 1
    keep = keep[found.played[keep] & np.isfinite(found.response[keep])]
    return {
        "frequency": found.frequency[keep],
        **_curve(found.response[keep]),
        "coherence": found.coherence[keep],
        "std": found.deviation[keep],
    }


def _verdict(content: dict[str, Any], method: str) -> tuple[str, str]:
    if method == "welch":
        trusted = np.asarray(content["welch"]["coherence"]) >= 0.9
        if not trusted.any():
            return "No frequency has a coherence of 0.9: drive and output hardly belong together.", "off"
        f = np.asarray(content["welch"]["frequency"])[trusted]
        text = f"Coherence of 0.9 and more from {number(f.min())} to {number(f.max())} Hz"
        return f"{text}. Noise and distortion lower it alike; a multisine of whole periods separates them.", "close"
    levels = content["levels_db"]
    parts = [
        f"{word} distortion {_words(levels[key])}"
        for key, word in (("odd_distortion", "odd"), ("even_distortion", "even"))
        if content[f"{word}_lines"] is not None
    ]
    if content["realisations"] > 1:
        parts.append(f"nonlinear part between realisations {_words(levels['nonlinear_between_realisations'])}")
    parts.append(f"noise {_words(levels['noise'])}")
    known = [v for k, v in levels.items() if k != "noise" and v is not None]
    text = f"At {number(content['drive_rms'])} V effective: {', '.join(parts)} (relative to the linear response)."
    if content["linear_fit_limit"] is not None:
        text += f" No linear model can fit this output to better than {content['linear_fit_limit']:.2f} %."
    elif len(parts) == 1:
        text += " Distortion is not separated from noise: play an odd multisine, or several realisations."
    worst = max(known, default=-np.inf)
    return text, "explained" if worst < _LINEAR_DB else "close" if worst < _CLOSE_DB else "off"


def _words(level: float | None) -> str:
    return "below the noise" if level is None else f"{number(level)} dB"
