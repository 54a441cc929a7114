"""Travel against the stroke. Position 0 of a model is mid stroke, and its stops are half a stroke to either side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from hydraulic_sim.arrays import Array
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import quantity, span

from .finding import CONTRADICTION, DOUBTFUL, Finding
from .observed import Observed

_TIMES_NOISE = 6.0  # standard deviations by which the extremes of a record stand out
TOUCH = 0.005  # of the stroke: what stops give way and a displacement sensor bends
_SCALE = 0.03  # of the stroke: what the scale of a displacement sensor may be off (data sheets: 1 to 3 %)


def beyond_stroke(records: Sequence[Observed]) -> list[Finding]:
    """The piston travels further than its stops are apart, or to where the model has a stop."""
    if "stroke" not in records[0].plant.model.entries:
        return []
    plant = records[0].plant
    low, high = readings_at_stops(plant, records[0].record.dt)
    touch = TOUCH * plant.value("stroke")
    ends = [(*quiet(s, touch), s.record.name) for s in records]
    first, retracted = min((float(x.min()) + noise, name) for x, noise, name in ends)
    last, extended = max((float(x.max()) - noise, name) for x, noise, name in ends)
    stroke, names = plant.value("stroke"), tuple(dict.fromkeys((retracted, extended)))
    travel, off = last - first, max(last - high, low - first)
    beyond = max(travel - (high - low), off)
    if beyond <= touch:
        return []
    severity = CONTRADICTION if beyond > _SCALE * stroke else DOUBTFUL
    if travel > high - low + touch:
        text = f"The piston travels {quantity(travel, 'm')}; the stroke is {quantity(stroke, 'm')}."
        remedy = "Correct stroke, or the scale of the position (column map: scale)."
        return [Finding("travel", "stroke", severity, text, remedy, travel, stroke, "m", names)]
    text = f"The position lies within {span(first, last, 'm')}; the model's stops are at {span(low, high, 'm')}."
    remedy = "Position 0 must be mid stroke: shift it (column map: offset), or correct stroke."
    return [Finding("zero", "position", severity, text, remedy, off, 0.0, "m", names)]


def quiet(seen: Observed, touch: float) -> tuple[Array, float]:
    """The position (N,) [m], averaged until its noise is small against ``touch`` [m] or over a window; and that noise.

    Of many noisy samples the largest is far off what the piston did.
    """
    noise = _TIMES_NOISE * seen.noise["position"]
    size = min(max(1, round((noise / (0.2 * touch)) ** 2)), seen.samples)
    return np.asarray(uniform_filter1d(seen.signals["position"], size, mode="nearest")), noise / size**0.5


def readings_at_stops(plant: Plant, dt: float) -> tuple[float, float]:
    """What the model's position sensor reads at both stops [m]."""
    states = np.tile(plant.initial_state().states, (2, 1))
    states[:, 0] = [-0.5 * plant.value("stroke"), 0.5 * plant.value("stroke")]
    read = plant.predict(np.zeros(2), dt, np.zeros(2, dtype=np.int64), 1, states)["position"][:, 0]
    return float(read[0]), float(read[1])
