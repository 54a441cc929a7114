"""Whether the experiments can show anything: long enough, moving, driven, and sampled fast enough for the oil."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.linear import poles
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import percent, quantity

from .finding import DOUBTFUL, NOT_IDENTIFIABLE, NOTE, Finding
from .observed import ROUGH, Observed

_SHORTEST = 4.5  # s of all records: nine segments of half a second, three blocks of which one is for validation
_STANDS = 0.8  # share of the time at rest from which the records are mostly noise
_LITTLE = 0.01  # of the drive's limit: a smaller standard deviation stays within dead band and null of any valve
_MANY = 10.0  # steps of the integrator from sample to sample, from which a search takes long
_PER_PERIOD = 2.5  # samples of the resonance's period below which it lies beyond what sampling shows


def too_short(records: Sequence[Observed]) -> list[Finding]:
    """All records together are shorter than fit and validation need."""
    total = sum(s.record.duration for s in records)
    if total >= _SHORTEST:
        return []
    text = f"The records last {quantity(total, 's')} together."
    remedy = f"Record {quantity(_SHORTEST, 's')} or more, so that segments are left for validation."
    return [Finding("short", "time", DOUBTFUL, text, remedy, total, _SHORTEST, "s", _names(records))]


def standing(records: Sequence[Observed]) -> list[Finding]:
    """The piston rests most of the time, over all records."""
    moving = np.concatenate([s.windows.moving for s in records])
    if not moving.size or moving.mean() >= 1.0 - _STANDS:
        return []
    share = 1.0 - float(moving.mean())
    text = f"The piston stands still for {percent(share)} of the time."
    remedy = "Cut the rest off (--window), or record an experiment that moves it: next_experiment designs one."
    return [Finding("standstill", "position", NOT_IDENTIFIABLE, text, remedy, share, None, "1", _names(records))]


def little_drive(records: Sequence[Observed]) -> list[Finding]:
    """The drive hardly moves in any record."""
    spread = max(float(np.std(s.opening)) for s in records)
    if spread >= _LITTLE:
        return []
    text = f"The drive varies by {percent(spread)} of its limit (standard deviation)."
    remedy = "Record a larger drive: `design` makes one that keeps within the limits."
    return [Finding("excitation", "drive", NOT_IDENTIFIABLE, text, remedy, spread, None, "1", _names(records))]


def slow_sampling(records: Sequence[Observed]) -> list[Finding]:
    """Too few samples in a period of the model's slowest resonance at mid stroke."""
    return [_slow(s, s.resonance) for s in records if s.resonance and ROUGH * s.resonance * s.record.dt > 1.0]


def _slow(seen: Observed, frequency: float) -> Finding:
    samples = 1.0 / (frequency * seen.record.dt)
    rate = 1.0 / seen.record.dt
    beyond = samples < _PER_PERIOD
    return Finding(
        "sampling",
        "bulk_modulus" if seen.plant.model.kind == "hydraulic" else "moving_mass",
        NOT_IDENTIFIABLE if beyond else NOTE,
        f"The model resonates at {quantity(frequency, 'Hz')}, and the record has {quantity(rate, 'Hz')}: {samples:.2g} "
        "samples in a period.",
        f"Sample at {quantity(2.0 * ROUGH * frequency, 'Hz')} or more"
        + (", or fix bulk_modulus and dead volumes: these records cannot identify them." if beyond else "."),
        rate,
        _PER_PERIOD * frequency,
        "Hz",
        seen.named,
    )


def small_steps(records: Sequence[Observed]) -> list[Finding]:
    """The integrator needs many steps from sample to sample, for what is far faster than the records."""
    model = records[0].plant.model
    cause, rate, step = Plant.for_fits(model).fastest
    steps = max(s.record.dt for s in records) / step
    if steps <= _MANY:
        return []
    mass = quantity(model.value("moving_mass"), "kg")
    if cause == "oil":
        remedy = f"Look at moving_mass ({mass}) and the dead volumes."
    else:
        length = quantity(model.value("bristle_length"), "m")
        remedy = f"Look at moving_mass ({mass}) and at {cause}; dry friction turns within bristle_length "
        remedy += f"({length}), which may be as long as what the position sensor resolves."
    text = (
        f"A simulation takes {steps:.0f} steps from sample to sample, for {cause} at {quantity(rate, '1/s')}: "
        "every verb that fits takes as many times longer."
    )
    return [Finding("steps", cause, NOTE, text, remedy, steps, _MANY, "1", _names(records))]


def resonance(model: Model) -> float | None:
    """Frequency [Hz] of the slowest oscillating mode of the model at rest in mid stroke; None where none oscillates."""
    try:
        found = poles(model)
    except SimulationError:
        return None
    swinging = np.abs(found[found.imag > 1e-6 * np.abs(found)])
    return float(swinging.min() / (2.0 * np.pi)) if swinging.size else None


def _names(records: Sequence[Observed]) -> tuple[str, ...]:
    return tuple(s.record.name for s in records)
