"""What the numbers of a comparison say, in sentences.

Every sentence follows from figures that stand in the same result, and carries them. Nothing here names a
cause: an error that changes sign with the direction of motion is said to do that, no more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.display import TITLES, first_upper, number, quantity

from .error_maps import ErrorMap
from .spectra import power_shares

AT_FLOOR = 1.5
"""Errors up to this multiple of what an exact model would show are called explained."""
WORTH_SAYING = 0.1
"""Least cross-validated share of the error's variance for which a variable is named, if chance stays below it."""
_MOSTLY = 0.5  # of the mean square: from here on an error is called mostly constant


@dataclass(frozen=True)
class Finding:
    """One sentence and the figures behind it. ``weight`` orders findings: larger says more."""

    channel: str
    kind: str
    text: str
    weight: float
    numbers: Mapping[str, Any]


def size_finding(channel: str, unit: str, rmse: float, exact: float, noise: float, horizon: float) -> Finding:
    """How large the error is beside what an exact model would show."""
    ratio = rmse / exact if exact > 0.0 else float("inf")
    title = first_upper(TITLES[channel])
    numbers = {"rmse": rmse, "exact_rmse": exact, "noise_std": noise, "ratio": ratio}
    if ratio <= AT_FLOOR:
        text = (
            f"{title} is explained to within the measurement noise: error {quantity(rmse, unit)} RMS "
            f"{horizon:g} s ahead, where an exact model would show {quantity(exact, unit)}."
        )
        return Finding(channel, "at_noise", text, 0.0, numbers)
    text = (
        f"{title} is missed by {quantity(rmse, unit)} RMS {horizon:g} s ahead, {number(ratio)} times the "
        f"{quantity(exact, unit)} that an exact model would show at this noise."
    )
    return Finding(channel, "above_noise", text, ratio, numbers)


def bias_finding(channel: str, unit: str, bias: float, rmse: float) -> Finding | None:
    """Whether most of an error is one constant."""
    share = (bias / rmse) ** 2 if rmse > 0.0 else 0.0
    if share < _MOSTLY:
        return None
    text = (
        f"The {TITLES[channel]} error is mostly constant: its mean of {quantity(bias, unit)} makes "
        f"{100 * share:.0f} % of its mean square."
    )
    return Finding(channel, "bias", text, share, {"bias": bias, "share": share})


def map_finding(channel: str, unit: str, variable: str, variable_unit: str, m: ErrorMap) -> Finding | None:
    """What the error looks like over one variable, or None if the variable explains too little to say."""
    if not m.explained >= max(WORTH_SAYING, m.chance_level) or m.center.size < 2:
        return None
    if is_own(channel, variable):
        return _own_finding(channel, unit, variable, m)
    shape, numbers = (
        _direction_shape(m, unit) if variable == "direction" else _curve_shape(m, unit, variable, variable_unit)
    )
    text = (
        f"The {TITLES[channel]} error {shape} "
        f"({TITLES[variable]} alone explains {100 * m.explained:.0f} % of its variance, cross-validated)."
    )
    numbers = {"variable": variable, "explained": m.explained, **numbers}
    return Finding(channel, "depends_on", text, m.explained, numbers)


def is_own(channel: str, variable: str) -> bool:
    """Whether a variable is the channel itself, or for a pressure the load pressure that it makes.

    An error in amplitude shows up there whatever its cause, and so does noise: such a pattern says less.
    """
    return channel == variable or (variable == "load_pressure" and channel.startswith("pressure_"))


def _own_finding(channel: str, unit: str, variable: str, m: ErrorMap) -> Finding:
    slope, _ = _line(m)
    text = (
        f"The {TITLES[channel]} error goes with the {TITLES[variable]} itself ({number(100 * slope)} % of it on "
        "average): amplitude or phase of its motion are not met."
    )
    numbers = {"variable": variable, "explained": m.explained, "slope": slope}
    return Finding(channel, "amplitude", text, m.explained, numbers)


def _direction_shape(m: ErrorMap, unit: str) -> tuple[str, dict[str, Any]]:
    by_sign = {int(round(c)): v for c, v in zip(m.center, m.mean, strict=True)}
    back, forth = by_sign.get(-1), by_sign.get(1)
    if back is None or forth is None:
        return "differs between standing and moving", {"means": by_sign}
    numbers = {"mean_retracting": back, "mean_extending": forth}
    pair = f"mean {quantity(forth, unit)} extending, {quantity(back, unit)} retracting"
    if _opposite(back, forth):
        return f"changes sign with the direction of motion: {pair}", numbers
    larger = "extending" if abs(forth) > abs(back) else "retracting"
    return f"is larger when {larger}: {pair}", numbers


def _curve_shape(m: ErrorMap, unit: str, variable: str, variable_unit: str) -> tuple[str, dict[str, Any]]:
    """Words for a curve of bin means: odd, even, rising, falling or local."""
    title = TITLES[variable]
    top, bottom = int(np.argmax(m.mean)), int(np.argmin(m.mean))
    numbers: dict[str, Any] = {
        "largest_mean": m.mean[top],
        "at": m.center[top],
        "smallest_mean": m.mean[bottom],
        "smallest_at": m.center[bottom],
    }
    ends = (
        f"mean {quantity(m.mean[bottom], unit)} near {quantity(m.center[bottom], variable_unit)}, "
        f"{quantity(m.mean[top], unit)} near {quantity(m.center[top], variable_unit)}"
    )
    _, correlation = _line(m)
    numbers["linear_correlation"] = correlation
    if variable in ("velocity", "drive", "spool", "load_pressure") and m.center[0] < 0.0 < m.center[-1]:
        odd = odd_share(m)
        below, above = _half_means(m)
        numbers |= {"odd_share": odd, "mean_below_zero": below, "mean_above_zero": above}
        if odd >= 0.8 and _opposite(below, above):
            if abs(correlation) >= 0.95:
                return f"is nearly proportional to {title}: {ends}", numbers
            return f"changes sign with {title}: {_sides(m, unit, variable_unit)}", numbers
        if odd <= 0.2:
            return f"depends on the size of {title}, not on its sign: {ends}", numbers
    if abs(correlation) >= 0.9:
        return f"{'rises' if correlation > 0 else 'falls'} with {title}: {ends}", numbers
    return f"varies with {title}: {ends}", numbers


def odd_share(m: ErrorMap) -> float:
    """Share of the bin means' power (without their overall mean) that is odd about zero, 0 … 1."""
    reach = min(-m.center[0], m.center[-1])
    grid = np.linspace(0.0, reach, 65)[1:]
    overall = float(np.average(m.mean, weights=m.count))
    right = np.interp(grid, m.center, m.mean) - overall
    left = np.interp(-grid[::-1], m.center, m.mean)[::-1] - overall
    odd, even = 0.5 * (right - left), 0.5 * (right + left)
    power = float(np.sum(odd**2) + np.sum(even**2))
    return float(np.sum(odd**2)) / power if power > 0.0 else 0.0


def _sides(m: ErrorMap, unit: str, variable_unit: str) -> str:
    """The largest bin means on either side of zero if they are opposite, else the sides' overall means."""
    sides = [np.flatnonzero(m.center < 0.0), np.flatnonzero(m.center > 0.0)]
    low, high = (int(side[np.argmax(np.abs(m.mean[side]))]) for side in sides)
    if _opposite(m.mean[low], m.mean[high]):
        return (
            f"mean up to {quantity(m.mean[high], unit)} near {quantity(m.center[high], variable_unit)}, "
            f"{quantity(m.mean[low], unit)} near {quantity(m.center[low], variable_unit)}"
        )
    below, above = _half_means(m)
    return f"mean {quantity(above, unit)} above zero, {quantity(below, unit)} below"


def _opposite(one: float, other: float) -> bool:
    """Whether two means have opposite signs and neither is a mere trace of the other."""
    return one * other < 0.0 and min(abs(one), abs(other)) > 0.2 * max(abs(one), abs(other))


def _half_means(m: ErrorMap) -> tuple[float, float]:
    below, above = m.center < 0.0, m.center > 0.0
    return (
        float(np.average(m.mean[below], weights=m.count[below])),
        float(np.average(m.mean[above], weights=m.count[above])),
    )


def _line(m: ErrorMap) -> tuple[float, float]:
    """Slope of the straight line through the bin means, weighted by their counts, and their correlation."""
    weights = m.count / m.count.sum()
    dx, dy = m.center - np.average(m.center, weights=weights), m.mean - np.average(m.mean, weights=weights)
    xx, yy, xy = (float(np.sum(weights * p)) for p in (dx**2, dy**2, dx * dy))
    return xy / xx, xy / np.sqrt(xx * yy) if yy > 0.0 else 0.0


def drift_finding(drift: float, detrended: float, rmse: float, record: str, duration: float) -> Finding | None:
    """How the free run leaves the measurement, where a straight line is most of it."""
    if not (rmse > 0.0 and detrended < 0.35 * rmse):
        return None
    text = (
        f"Free run of {record}: the simulated piston drifts away by {quantity(abs(drift) * duration, 'm')} "
        f"in {duration:.0f} s, nearly in a straight line (an integrating plant keeps every small error of "
        f"flow); {quantity(detrended, 'm')} RMS remain without the line."
    )
    numbers = {"drift": drift, "rmse": rmse, "rmse_detrended": detrended, "record": record}
    return Finding("position", "drift", text, 0.0, numbers)


def frequency_finding(channel: str, record: str, frequency: Array, density: Array, noise: Array) -> Finding | None:
    """In which band most of the error above the noise lies, if one band holds most of it."""
    limits = (0.5, 2.0, 10.0, 30.0, 100.0)
    names = ("below 0.5 Hz", "0.5–2 Hz", "2–10 Hz", "10–30 Hz", "30–100 Hz", "above 100 Hz")
    shares = power_shares(frequency, density, noise, limits)
    best = int(np.argmax(shares))
    if shares[best] < 0.5:
        return None
    text = (
        f"Of the {TITLES[channel]} error in the free run of {record} (its drift taken out), "
        f"{100 * shares[best]:.0f} % of the power above the noise lies {'' if best in (0, 5) else 'at '}{names[best]}."
    )
    numbers = {"record": record, "bands_hz": limits, "shares": shares}
    return Finding(channel, "frequency", text, 0.01 * shares[best], numbers)
