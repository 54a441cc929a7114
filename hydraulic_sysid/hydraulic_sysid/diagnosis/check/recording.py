"""What is wrong with channels as such: constant, clipped, frozen, a drive beyond its limit or always at it."""

from __future__ import annotations

import math

import numpy as np

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sysid.data.display import percent, quantity
from hydraulic_sysid.estimation.saturation import at_end_of_range

from .finding import CONTRADICTION, DOUBTFUL, NOT_IDENTIFIABLE, NOTE, Finding
from .observed import MEASURED, Observed

_FLICKERS = 0.5  # share of samples equal to the one before, below which noise shows that a channel is alive
_RUN = 20  # equal samples in a row at least that make a channel frozen or clipped …
_TIMES = 3.0  # … and so many times the longest run that its noise makes
_BEYOND = 1.01  # of the drive's limit: what rounding and the amplifier's tolerance allow
_AT_LIMIT = 0.995  # of the limit
_SATURATED = 0.8  # share of a record at the limit from which the valve is little more than a switch


def constant(seen: Observed) -> list[Finding]:
    """Channels that never change while the piston moves."""
    moves = bool(seen.windows.moving.any())
    found = []
    for channel in MEASURED[1:]:
        if channel in seen.signals and moves and np.ptp(seen.signals[channel]) == 0.0:
            value = float(seen.signals[channel][0])
            shown = quantity(value, "Pa")
            text = f"{channel} stays at {shown} throughout while the piston moves."
            remedy = "Look at the sensor and its column; leave the channel out of the record until it works."
            found.append(Finding("constant", channel, CONTRADICTION, text, remedy, value, None, "Pa", seen.named))
    return found


def clipped(seen: Observed) -> list[Finding]:
    """Sensors that sit at their largest or smallest value: too long for their noise, or with it cut off."""
    found = []
    for channel in MEASURED:
        if channel not in seen.signals:
            continue
        values = seen.record[channel]
        at = at_end_of_range(values)
        for extreme in (float(values.max()), float(values.min())):
            exactly = values == extreme
            if _longest(exactly) > _allowed(values):
                at = at | exactly
        if at.any():
            unit, edge = seen.record.unit(channel), float(np.median(values[at]))
            text = f"{channel} sits at its end, {quantity(edge, unit)}, for {percent(float(at.mean()))} of the time."
            remedy = "The converter is at its end: enlarge its range. A diagnosis sets these parts aside."
            found.append(Finding("clipped", channel, DOUBTFUL, text, remedy, edge, None, unit, seen.named))
    return found


def frozen(seen: Observed) -> list[Finding]:
    """All sensors repeat their last value together: the logger has missed samples and filled the gap."""
    channels = [c for c in MEASURED if c in seen.signals and np.ptp(seen.record[c]) > 0.0]
    if len(channels) < 2 or any(math.isinf(_allowed(seen.record[c])) for c in channels):
        return []  # of a single channel `clipped` says what can be said
    same = np.logical_and.reduce([np.diff(seen.record[c]) == 0.0 for c in channels])
    length = _longest(same)
    if length <= min(_allowed(seen.record[c]) for c in channels):
        return []
    seconds = length * seen.record.dt
    text = (
        f"All sensors stand still to the last digit for up to {quantity(seconds, 's')}, though they flicker elsewhere."
    )
    remedy = "The logger has filled a gap: split the record there, or cut it (--window)."
    return [Finding("gap", "position", DOUBTFUL, text, remedy, seconds, None, "s", seen.named)]


def beyond_limit(seen: Observed) -> list[Finding]:
    """A drive beyond the limit at which it saturates."""
    largest, limit = float(np.abs(seen.signals["drive"]).max()), seen.plant.value("drive_limit")
    if largest <= _BEYOND * limit:
        return []
    text = f"The drive reaches {quantity(largest, 'V')}; the model's saturates at {quantity(limit, 'V')}."
    remedy = "The drive was logged before its limit (the model clips it), or drive_limit is wrong."
    return [Finding("drive_limit", "drive_limit", DOUBTFUL, text, remedy, largest, limit, "V", seen.named)]


def saturated(seen: Observed) -> list[Finding]:
    """A drive that is at its limit most of the time shows the valve at two openings alone."""
    share = float(np.mean(np.abs(seen.opening) >= _AT_LIMIT))
    if share <= _SATURATED:
        return []
    text = f"The drive is at its limit for {percent(share)} of the time."
    remedy = "Record a smaller drive as well: effects around the valve's centre do not show at full opening."
    return [Finding("saturated", "drive", NOT_IDENTIFIABLE, text, remedy, share, None, "1", seen.named)]


def reader_notes(seen: Observed) -> list[Finding]:
    """What the reader of the file assumed or filled in: resampled gaps, the command taken for the drive."""
    channels = {note: note.partition(":")[0] for note in seen.record.notes}
    remedy = "Nothing, where that is meant."
    return [Finding("reader", c, NOTE, f"{note}.", remedy, records=seen.named) for note, c in channels.items()]


def _longest(flags: Mask) -> int:
    """Longest run of true values (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _allowed(values: Array) -> float:
    """Equal samples in a row that the noise of a channel (N,) makes; infinite where there is too little to flicker."""
    same = float(np.mean(np.diff(values) == 0.0))
    if same >= _FLICKERS:
        return math.inf
    return max(_RUN, _TIMES * math.log(values.size) / -math.log(max(same, 1e-3)))
