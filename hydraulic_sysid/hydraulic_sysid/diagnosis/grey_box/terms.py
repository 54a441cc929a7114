"""What the black box may use: the drive and its past, and what the white box predicts. Nothing measured.

So the grey box can be run wherever the white box can. The linear terms are delayed drives and predicted channels; the
nonlinear ones are the shapes by which hydraulic effects differ from a linear model: direction of motion, magnitudes,
squares, bends (hinges) along drive, velocity, position and load pressure, and what these do by direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sysid.data.display import TITLES
from hydraulic_sysid.data.resampling import delayed

LAGS = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Delays of the drive in seconds."""
BENDS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Quantiles of a signal at which it may bend."""
_STANDING = 0.01  # of the largest velocity: slower motion has no direction to speak of


@dataclass(frozen=True)
class Scales:
    """Sizes and bends taken from the estimation data, so that a term means the same on all data."""

    size: dict[str, float]
    bends: dict[str, tuple[float, ...]]

    @classmethod
    def of(cls, signals: Sequence[Mapping[str, Array]]) -> Scales:
        """From the records that are fitted."""
        whole = {name: np.concatenate([s[name] for s in signals]) for name in signals[0]}
        size = {name: float(np.max(np.abs(x))) or 1.0 for name, x in whole.items()}
        bends = {name: tuple(np.unique(np.quantile(x / size[name], BENDS))) for name, x in whole.items()}
        return cls(size, bends)


@dataclass(frozen=True)
class Terms:
    """``names`` in words, ``values`` (N, k), and which of them are linear."""

    names: list[str]
    values: Array
    linear: Mask


def terms(signals: Mapping[str, Array], dt: float, scales: Scales) -> Terms:
    """All candidate terms of one record; ``signals`` are drive and predicted channels ``(N,)`` every ``dt`` seconds."""
    s = {name: values / scales.size[name] for name, values in signals.items()}
    found: list[tuple[str, Array, bool]] = [("constant", np.ones(s["drive"].size), True)]
    for lag in sorted({round(lag / dt) for lag in LAGS}):
        when = f" {lag * dt * 1e3:g} ms before" if lag else ""
        found.append((f"drive{when}", delayed(s["drive"], lag), True))
    found += [(_title(name), x, True) for name, x in s.items() if name != "drive"]
    direction = np.tanh(s["velocity"] / _STANDING)
    found.append(("direction of motion", direction, False))
    for name, x in s.items():
        found.append((f"|{_title(name)}|", np.abs(x), False))
        found.append((f"{_title(name)}·|{_title(name)}|", x * np.abs(x), False))
        found.append((f"{_title(name)}³", x**3, False))
        for bend in scales.bends[name]:
            found.append((f"bend of {_title(name)} at {bend:+.2f} of its range", np.maximum(x - bend, 0.0), False))
    for name in ("position", "load_pressure", "drive"):
        if name in s:
            found.append((f"{_title(name)} by direction", direction * s[name], False))
    if "load_pressure" in s:
        # To first order what the load pressure takes from an orifice's flow, |u|·p_L.
        found.append(("|drive|·load pressure", np.abs(s["drive"]) * s["load_pressure"], False))
    found.append(("velocity·position", s["velocity"] * s["position"], False))
    return Terms(
        [name for name, *_ in found],
        np.column_stack([x for _, x, _ in found]),
        np.array([linear for *_, linear in found]),
    )


def _title(channel: str) -> str:
    return TITLES.get(channel, channel)
