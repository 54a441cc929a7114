"""A fitted model with its sensitivities: the point from which candidates are judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.estimate import Settings, fit_pieces, scale
from hydraulic_sysid.estimation.shooting import Linear, Shooting

from .pieces import Split

Array = NDArray[np.float64]

SCATTER = 2.0  # factor by which a plant may be off a data sheet that states no bounds
_RESTS = 3  # times that the starts of pieces are moved to where they fit best


@dataclass(frozen=True)
class Anchor:
    """A model fitted to the fitted pieces, linearised on all of them.

    ``columns[i]`` (S, m, P): change of record i's residuals with each parameter, over its scale; ``beyond[i]`` the
    same without what the starts of the pieces explain.
    """

    model: Model
    split: Split
    scales: dict[str, float]
    shooting: Shooting
    linear: list[Linear]
    columns: list[Array]
    beyond: list[Array]

    @property
    def keys(self) -> list[str]:
        return list(self.scales)

    @cached_property
    def values(self) -> dict[str, float]:
        return {k: self.model.value(k) for k in self.scales}

    @cached_property
    def residual(self) -> list[Array]:
        """(S, m) per record, over the noise, the starts' influence taken out."""
        return [lin.residual for lin in self.linear]

    @cached_property
    def costs(self) -> list[Array]:
        """(S,) per record: sum of squares of each piece."""
        return [np.sum(r**2, axis=1) for r in self.residual]

    @cached_property
    def information(self) -> Array:
        """(P, P) over the fitted pieces."""
        return inner(self.split, self.beyond, self.beyond)

    def some(self, chosen: Sequence[NDArray[np.bool_]]) -> Anchor:
        """The same point seen on ``chosen[i]`` (S_i,) pieces of every record alone, all of which count as fitted."""
        used = [i for i, c in enumerate(chosen) if c.any()]
        pieces = [self.split.pieces[i].some(chosen[i]) for i in used]
        shooting = Shooting(self.shooting.plant, pieces)
        shooting.starts = [self.shooting.starts[i][chosen[i]] for i in used]
        return Anchor(
            self.model,
            Split(pieces, [np.ones(len(p.starts), dtype=bool) for p in pieces]),
            self.scales,
            shooting,
            [
                Linear(*(a[chosen[i]] for a in (self.linear[i].raw, self.linear[i].basis, self.linear[i].back)))
                for i in used
            ],
            [self.columns[i][chosen[i]] for i in used] if self.columns else [],
            [self.beyond[i][chosen[i]] for i in used],
        )

    def slim(self) -> Anchor:
        """The same without ``columns``, which only refits need: a search keeps several anchors in memory."""
        return replace(self, columns=[])

    @property
    def bounds(self) -> list[tuple[float, float]]:
        return [self.model.entry(k).bounds for k in self.scales]  # type: ignore[misc]


def inner(split: Split, left: Sequence[Array], right: Sequence[Array]) -> Array:
    """Σ over the fitted pieces of left·right: (S, m, P), (S, m, Q) → (P, Q)."""
    total: Array = np.zeros(())
    for chosen, a, b in zip(split.fitted, left, right, strict=True):
        if chosen.any():
            total = total + np.tensordot(a[chosen], b[chosen], axes=([0, 1], [0, 1]))
    return np.atleast_2d(total)


def project(linear: Sequence[Linear], columns: Sequence[Array]) -> list[Array]:
    """Columns (S, m, P) without what the starts explain."""
    found = []
    for lin, c in zip(linear, columns, strict=True):
        seen = np.einsum("smf,smp->sfp", lin.basis, c, optimize=True)
        found.append(c - np.einsum("smf,sfp->smp", lin.basis, seen, optimize=True))
    return found


def keys_of(model: Model) -> list[str]:
    """What a diagnosis fits: the free parameters and those that smooth corners."""
    return list(dict.fromkeys((*model.free_keys(), *model.nuisance_keys())))


def bounded(model: Model) -> Model:
    """The model with bounds on free base parameters whose file gives none: half to twice their value.

    While an effect is missing, a fit would else bend a mass or a flow to many times what a data sheet says.
    """
    for key in model.free_keys():
        own = model.entries.get(key)
        if "." not in key and own is not None and own.bounds is None and own.value > 0.0:
            low, high = model.parameter(key).bounds
            model = model.with_entry(key, bounds=(max(low, own.value / SCATTER), min(high, own.value * SCATTER)))
    return model


def fitted(
    model: Model,
    split: Split,
    settings: Settings | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Model:
    """The model with its parameters fitted to the fitted pieces."""
    settings = settings or Settings()
    done = fit_pieces(model, Plant(model), split.to_fit, keys_of(model), settings, progress)
    return model.with_values(within(model, done.values), source="fitted")


def within(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """The values within the library's bounds, which rounding may leave by a little."""
    found = {}
    for key, value in values.items():
        low, high = model.parameter(key).bounds
        found[key] = min(max(value, low), high)
    return found


def anchor(model: Model, split: Split) -> Anchor:
    """Linearise a model, fitted before, on all pieces."""
    keys = keys_of(model)
    shooting = Shooting(Plant(model), split.pieces)
    values: Mapping[str, float] = {k: model.value(k) for k in keys}
    linear = shooting.settle(values)
    cost = _total(linear)
    for _ in range(_RESTS):
        before = [s.copy() for s in shooting.starts]
        again = shooting.settle(values)
        if _total(again) >= cost:
            shooting.starts = before
            break
        rested = cost - _total(again) < 1e-4 * cost
        linear, cost = again, _total(again)
        if rested:
            break
    scales = {k: scale(model, k) for k in keys}
    columns = shooting.jacobian(values, scales, [lin.raw for lin in linear])
    return Anchor(model, split, scales, shooting, linear, columns, project(linear, columns))


def _total(linear: Sequence[Linear]) -> float:
    return float(sum(np.sum(lin.residual**2) for lin in linear))
