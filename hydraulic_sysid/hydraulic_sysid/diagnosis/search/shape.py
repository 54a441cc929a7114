"""The shape of what no library effect explains: a curve without a law, over the variable that explains most.

At every place of the plant where something may be added (`shapes`), and over every variable there, a curve of
linear splines is fitted to the residual: by the sensitivities to its knots beyond those of the free parameters, so
that the dynamics between the missing piece and the sensors is that of the model and nothing is differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.effect import Effect
from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant

from .anchor import Anchor, inner, project
from .candidates import subsystem
from .screen import sample
from .shapes import FILES

Array = NDArray[np.floating]

KNOTS = 9
_RIDGE = 1e-6  # of the largest diagonal: knots that nothing visits
_VISITED = 1e-3  # of the largest information: a knot below is not shown
_RANGE = (0.005, 0.995)  # quantiles between which knots are laid


@dataclass(frozen=True)
class Shape:
    """A curve: ``height`` (K,) ± ``error`` [``unit``] over ``centre`` (K,) [the variable's unit].

    ``gain``: of the sum of squares on the pieces looked at; ``share``: of what noise does not explain there.
    """

    place: str
    subsystem: str
    summary: str
    variable: str
    unit: str
    gain: float
    share: float
    centre: Array
    height: Array
    error: Array


def shapes(anchor: Anchor, say: Callable[[str], None]) -> list[Shape]:
    """All curves, the one that explains most first. Empty for a plant that takes none of them."""
    part, _ = sample(anchor)
    model = replace(part.model, user_effects=(*part.model.user_effects, *FILES))
    shooting = part.shooting
    seen = _seen(part)
    noise = sum(float(lin.raw.size - lin.basis.shape[0] * lin.basis.shape[2]) for lin in part.linear)
    excess = max(sum(float(np.sum(r**2)) for r in part.residual) - noise, 1e-300)
    found: list[Shape] = []
    for file in FILES:
        name = file.stem
        try:
            extended = model.with_effect(name)
            extended.check_complete()
        except ModelError:  # the plant has no such stage
            continue
        plant = Plant(extended)
        base = shooting.run(plant.with_parameters({**anchor.values, f"{name}.height": 0.0}))
        effect = model.library[name]
        say(f"shape of {effect.summary}")
        for index, variable in enumerate(_variables(effect)):
            if variable not in seen:
                continue
            curve = _curve(part, plant, effect, index, variable, seen[variable], base, excess)
            if curve is not None:
                found.append(curve)
    return sorted(found, key=lambda s: -s.gain)


def _variables(effect: Effect) -> tuple[str, ...]:
    return effect.kernel.__globals__["VARIABLES"]


def _seen(anchor: Anchor) -> dict[str, Array]:
    """Values that the variables take in the records."""
    pieces = anchor.split.pieces
    model: Model = anchor.model
    position = np.concatenate([p.seen[:, 0] for p in pieces])
    velocity = np.concatenate([p.seen[:, 1] for p in pieces])
    opening = np.concatenate([np.clip(p.record["drive"] / model.value("drive_limit"), -1.0, 1.0) for p in pieces])
    values = {
        "position": position,
        "reading": position,
        "velocity": velocity,
        "speed": np.abs(velocity),
        "opening": opening,
        "size_of_opening": np.abs(opening),
        "time": np.concatenate([np.arange(len(p.record)) * p.record.dt for p in pieces]),
    }
    if model.kind == "hydraulic" and all({"pressure_a", "pressure_b"} <= set(p.channels) for p in pieces):
        a = np.concatenate([p.seen[:, 2] for p in pieces])
        b = np.concatenate([p.seen[:, 3] for p in pieces])
        values |= {"pressure_a": a, "pressure_b": b, "mean_pressure": 0.5 * (a + b)}
        values |= {"pressure_difference": a - b, "size_of_pressure_difference": np.abs(a - b)}
    return values


def _curve(
    anchor: Anchor, plant: Plant, effect: Effect, index: int, variable: str, values: Array, base: Sequence[Array],
    excess: float,
) -> Shape | None:  # fmt: skip
    low, high = (float(np.quantile(values, q)) for q in _RANGE)
    if not high - low > 1e-9 * max(abs(low), abs(high), 1e-12):
        return None
    centre = np.linspace(low, high, KNOTS)
    size = next(p.default for p in effect.parameters if p.name == "height")
    columns = []
    for z in centre:
        values_of = {"over": float(index), "centre": float(z), "width": float(centre[1] - centre[0]), "height": size}
        try:
            raw = anchor.shooting.run(
                plant.with_parameters({**anchor.values, **{f"{effect.name}.{k}": v for k, v in values_of.items()}})
            )
        except SimulationError:
            return None
        columns.append([r - b for r, b in zip(raw, base, strict=True)])
    new = project(anchor.linear, [np.stack([c[i] for c in columns], axis=-1) for i in range(len(base))])
    cross = inner(anchor.split, anchor.beyond, new)
    information = inner(anchor.split, new, new)
    residual = [r[..., None] for r in anchor.residual]
    gradient = inner(anchor.split, new, residual)[:, 0]
    if anchor.keys:
        solved = np.linalg.pinv(anchor.information, rcond=1e-12, hermitian=True) @ cross
        information = information - cross.T @ solved
        gradient = gradient - solved.T @ inner(anchor.split, anchor.beyond, residual)[:, 0]
    ridge = _RIDGE * float(np.max(np.diag(information)))
    if not ridge > 0.0:
        return None
    inverse = np.linalg.inv(information + ridge * np.eye(KNOTS))
    height = -inverse @ gradient
    gain = float(-2.0 * gradient @ height - height @ information @ height)
    spread = max(1.0, np.sqrt(sum(float(np.sum(r**2)) for r in anchor.residual) / sum(r.size for r in anchor.residual)))
    error = np.sqrt(np.maximum(np.diag(inverse), 0.0)) * spread
    shown = np.diag(information) > _VISITED * float(np.max(np.diag(information)))
    unit = next(p.unit for p in effect.parameters if p.name == "height")
    return Shape(
        effect.name, subsystem(effect), effect.summary, variable, unit, gain, min(gain / excess, 1.0), centre[shown],
        height[shown] * size, 1.96 * error[shown] * size,
    )  # fmt: skip
