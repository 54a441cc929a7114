"""A fitted model with its sensitivities: the point from which candidates are judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.fit import FitPoint
from hydraulic_sysid.estimation.known_starts import KnownStarts
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations, bounded_step
from hydraulic_sysid.estimation.parameters import NO_PRIORS, Parameters, Priors

from .holdout import Split


@dataclass(frozen=True)
class Linearisation:
    """A model fitted to the segments of ``split`` that are for fitting, linearised on all of them.

    ``known``: `beyond`, where it was taken before.
    """

    model: Model
    split: Split
    point: FitPoint
    known: list[Array] | None = None

    @classmethod
    def of(
        cls, model: Model, split: Split, priors: Priors = NO_PRIORS, starts: KnownStarts | None = None
    ) -> Linearisation:
        """Of a model that was fitted before: each segment from where that leaves less, ``starts`` or the record."""
        plant, keys = Plant.for_fits(model), model.movable_keys()
        point = FitPoint.begin(plant, split.segments, keys, priors=priors)
        if starts is not None:
            known = starts.of(split.segments, point.shooting.initial_states)
            point = point.better_of(point.settled(point.shooting, point.parameters, known))
        return cls(model, split, point.at_rest())

    @property
    def columns(self) -> list[Array]:
        """(S, m, P) per record: change of the residuals with each parameter, over its scale; taken when asked for."""
        return self.point.columns

    @cached_property
    def beyond(self) -> list[Array]:
        """The same without what the initial states explain."""
        return self.point.beyond(self.columns) if self.known is None else self.known

    @property
    def parameters(self) -> Parameters:
        """Those that were fitted."""
        return self.point.parameters

    @cached_property
    def residual(self) -> list[Array]:
        """(S, m) per record, over the noise, the influence of the initial states taken out."""
        return [p.residual for p in self.point.projections]

    @cached_property
    def costs(self) -> list[Array]:
        """(S,) per record: sum of squares of each segment."""
        return [np.sum(r**2, axis=1) for r in self.residual]

    @cached_property
    def normal(self) -> NormalEquations:
        """Over the segments for fitting."""
        scores = [
            np.einsum("smp,sm->sp", b[chosen], r[chosen])
            for b, r, chosen in zip(self.beyond, self.residual, self.split.fit, strict=True)
            if chosen.any()
        ]
        information = self._inner(self.beyond, self.beyond) + np.diag(self.parameters.prior_information)
        return NormalEquations(information, tuple(scores), self.parameters.prior_gradient)

    @cached_property
    def own_reduction(self) -> float:
        """By how much a step of the parameters alone would lower the sum of squares, to first order."""
        return self.normal.reduction(bounded_step(self.normal, self.parameters))

    def bordered(
        self,
        columns: Sequence[Array],
        residual: Sequence[Array] | None = None,
        parameters: Parameters | None = None,
    ) -> NormalEquations:
        """Of the parameters and, behind them, of what else changes the residuals by ``columns[i]`` (S, m, Q).

        The gradient is that of ``residual[i]`` (S, m) at ``parameters``, by default that of the linearisation.
        """
        new = self.point.beyond(columns)
        cross = self._inner(self.beyond, new)
        left = [r[..., None] for r in (residual or self.residual)]
        gradient = np.concatenate((self._inner(self.beyond, left), self._inner(new, left)))
        own = self.normal.information
        prior = np.concatenate(((parameters or self.parameters).prior_gradient, np.zeros(new[0].shape[-1])))
        return NormalEquations(np.block([[own, cross], [cross.T, self._inner(new, new)]]), (gradient.T,), prior)

    def changes(self, plants: Sequence[Plant]) -> list[Array]:
        """By how much (S, m, Q) the residuals change with each of these plants in the place of the model's.

        :raises hydraulic_sim.errors.SimulationError: a plant does not run from these initial states.
        """
        runs = [self.point.shooting.try_out(plant, self.point.initial_states) for plant in plants]
        return [np.stack([run[i] - p.raw for run in runs], axis=-1) for i, p in enumerate(self.point.projections)]

    def sample(self, most: int) -> tuple[Linearisation, float]:
        """The same on about ``most`` segments for fitting, spread over all records; and what share of them that is."""
        total = sum(int(f.sum()) for f in self.split.fit)
        every = max(1, round(total / most))
        chosen = []
        for fit in self.split.fit:
            keep = np.zeros_like(fit)
            keep[np.flatnonzero(fit)[::every]] = True
            chosen.append(keep)
        return self._subset(chosen), sum(int(c.sum()) for c in chosen) / max(total, 1)

    def of_one_record(self) -> Linearisation:
        """The same on the segments for fitting of the record that leaves most."""
        left = [float(np.sum(c[f])) for c, f in zip(self.costs, self.split.fit, strict=True)]
        most = left.index(max(left))
        return self._subset([f if i == most else np.zeros_like(f) for i, f in enumerate(self.split.fit)])

    def slim(self) -> Linearisation:
        """The same without ``columns``, which only refits need: a search keeps several linearisations in memory."""
        return replace(self, point=replace(self.point), known=self.beyond)

    def _subset(self, chosen: Sequence[Mask]) -> Linearisation:
        point = self.point.subset(chosen)
        split = Split(list(point.shooting.segments), [np.ones(len(s), dtype=bool) for s in point.shooting.segments])
        beyond = [b[c] for b, c in zip(self.beyond, chosen, strict=True) if c.any()]
        return Linearisation(self.model, split, point, beyond)

    def _inner(self, left: Sequence[Array], right: Sequence[Array]) -> Array:
        """Σ over the segments for fitting of left·right: (S, m, P), (S, m, Q) → (P, Q)."""
        total = np.zeros((left[0].shape[-1], right[0].shape[-1]))
        for chosen, a, b in zip(self.split.fit, left, right, strict=True):
            total += np.tensordot(a, b if chosen.all() else b * chosen[:, None, None], axes=([0, 1], [0, 1]))
        return total
