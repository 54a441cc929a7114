"""Fits parameters within bounds and the initial state of every segment to records.

The initial states are eliminated at every step (`projection`), which leaves a small bounded problem in the parameters
(`levenberg_marquardt`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hydraulic_sim.arrays import Array, Mask
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record

from .errors import CalibrationError
from .known_starts import KnownStarts
from .levenberg_marquardt import Minimum, NormalEquations, minimise
from .parallel import results
from .parameters import NO_PRIORS, Parameters, Priors
from .projection import Projection
from .segments import Segments, cut, segment_length
from .shooting import Shooting

_SETTLED = 1e-4  # share of a cost below which moving initial states on gains no more
_ROUNDS = 4  # times that they are moved at most
_NEAR = 2.0  # median mean square over noise of the segments, up to which …
_STUCK = 5.0  # … those that lie so many standard deviations of a mean square above it may be stuck; …
_STUCK_ROUNDS = 10  # … times that they are moved at most, …
_STUCK_SHARES = (1.0, 0.3, 0.1)  # … by which of the way that the directions show
_NEARER = 0.8  # of the misfit before: a smaller one lets unmeasured pressures go further
# Of the sum of squares where the directions of the initial states were taken: below, they are taken anew …
_OUTDATED = 0.8
_OUTDATED_AT_END = 200.0  # … and where a fit would end, if it has fallen by so many of its least gains
_MILD = 3.0  # residual over noise from which a robust loss counts less than the square


@dataclass(frozen=True)
class FitSettings:
    """What a user may choose about a fit."""

    length: float | None = None
    """Seconds of a segment; None: as the plant asks for (`segments.segment_length`)."""
    robust: bool = False
    """Let residuals beyond three times the noise count less (soft L1)."""
    most_steps: int = 25
    tolerance: float = 0.1
    """The fit is done when another step would be shorter than this many standard errors."""
    least_gain: float = 1e-6
    """Or when a step lowers the sum of squares by no more than this share."""

    def seconds(self, model: Model, records: Sequence[Record]) -> float:
        """Of a segment of these records."""
        return self.length or segment_length(model, records)


@dataclass(frozen=True)
class FitPoint:
    """Parameters and initial states of a fit, and what is left there. Nothing of it changes: a step gives another.

    ``directions_cost``: sum of squares where the directions in which initial states act were taken; ``derived``: the
    derivatives of the point before, with what the step there has shown of them (Broyden, Math. Comp. 19 (1965) 577).
    """

    shooting: Shooting
    parameters: Parameters
    initial_states: list[Array]
    projections: list[Projection]
    robust: bool = False
    directions_cost: float = 0.0
    derived: list[Array] | None = None

    @classmethod
    def begin(
        cls,
        plant: Plant,
        segments: Sequence[Segments],
        keys: Sequence[str],
        robust: bool = False,
        priors: Priors = NO_PRIORS,
        starts: KnownStarts | None = None,
    ) -> FitPoint:
        """A model as it is, initial states moved once to where they fit best.

        :param starts: from where they are moved, where that leaves less than where the records show them
        """
        shooting = Shooting(plant, segments)
        point = cls(shooting, Parameters.of(plant.model, keys, priors), shooting.initial_states, [], robust)
        if starts is not None:
            point = replace(point, initial_states=shooting.nearer(plant, starts.of(segments, shooting.initial_states)))
        if any(s.unmeasured_pressures.any() for s in segments):
            raw = shooting.residuals(point.plant, point.initial_states)
            shooting = replace(shooting, misfit=_misfit(segments, raw))
        return point.settled(shooting, point.parameters)

    @property
    def plant(self) -> Plant:
        """With the parameters of this point."""
        return self.shooting.plant.with_parameters(self.parameters.by_key)

    @cached_property
    def cost(self) -> float:
        """Sum of squared residuals over noise, or what a robust loss makes of them."""
        squares = sum(np.sum(loss(p.residual, self.robust)) for p in self.projections)
        return float(squares) + self.parameters.prior_cost

    @property
    def costs(self) -> list[Array]:
        """(S,) per record: sum of squares of each segment."""
        return [p.costs for p in self.projections]

    @cached_property
    def normal(self) -> NormalEquations:
        """With the initial states eliminated."""
        each = zip(self._beyond, [p.residual for p in self.projections], strict=True)
        parts = list(results(lambda one: self._normal_of(*one), each))
        information = np.diag(self.parameters.prior_information) + sum(own for own, _ in parts)
        scores = [score for _, score in parts]
        return NormalEquations(information, tuple(scores), self.parameters.prior_gradient)

    def _normal_of(self, beyond: Array, residual: Array) -> tuple[Array, Array]:
        """What one record gives to the normal equations: JᵀJ and, per segment, Jᵀr."""
        weighted = beyond * _weights(residual)[..., None] if self.robust else beyond
        score = (np.swapaxes(weighted, -1, -2) @ residual[..., None])[..., 0]
        return np.asarray(np.tensordot(weighted, beyond, axes=([0, 1], [0, 1]))), score

    @cached_property
    def columns(self) -> list[Array]:
        """Derivatives (S, m, P) of the residuals by the parameters over their scales, per record."""
        if self.derived is not None:
            return self.derived
        return self.shooting.jacobian(
            self.plant, self.parameters, self.initial_states, [p.raw for p in self.projections]
        )

    @cached_property
    def _beyond(self) -> list[Array]:
        return self.beyond(self.columns)

    def beyond(self, columns: Sequence[Array]) -> list[Array]:
        """What of them the initial states cannot explain."""
        pairs = zip(self.projections, columns, strict=True)
        return list(results(lambda pair: pair[0].beyond(pair[1]), pairs))

    def settled(
        self,
        shooting: Shooting,
        parameters: Parameters,
        initial_states: Sequence[Array] | None = None,
        shares: Sequence[float] = (1.0,),
    ) -> FitPoint:
        """Other parameters, or another weight of the priors; initial states moved to where they then fit best.

        :param initial_states: from where they are moved; by default those of this point
        :param shares: of the way there that are tried
        """
        plant = shooting.plant.with_parameters(parameters.by_key)
        states = shooting.settled(plant, self.initial_states if initial_states is None else initial_states, shares)
        point = FitPoint(shooting, parameters, *states, self.robust)
        return replace(point, directions_cost=point.cost)

    def moved(self, change: Array) -> FitPoint | None:
        """A change (P,) of the parameters away; None where the plant does not run there.

        Initial states begin where they will fit best, to first order, or where they only follow the parameters: in
        segments far from linear the former may lead nowhere. The directions in which they act are kept.
        """
        shooting, steps = self.shooting, list(results(lambda c: c @ change, self.columns))
        parameters = self.parameters.moved(change)
        plant = shooting.plant.with_parameters(parameters.by_key)
        starts = [
            shooting.corrected(self.initial_states, self.projections, ahead)
            for ahead in (steps, [p.raw + s for p, s in zip(self.projections, steps, strict=True)])
        ]
        try:
            states, before = shooting.better(plant, self.projections, *starts)
            initial_states, projections = shooting.improved(plant, states, before)
        except SimulationError:
            return None
        there = replace(
            self, parameters=parameters, initial_states=initial_states, projections=projections, derived=None
        )
        return replace(there, derived=self._derived(change, projections)) if there.cost < self.cost else there

    def _derived(self, change: Array, there: Sequence[Projection]) -> list[Array]:
        """The derivatives, so changed that they give what a step has shown, and little where it did not lead."""
        weighted = change * np.diag(self.normal.information)
        share = weighted / max(float(weighted @ change), 1e-300)

        def changed(each: tuple[Array, Array, Projection, Projection]) -> Array:
            columns, own, p, new = each
            shown = p.beyond((new.raw - p.raw)[..., None])[..., 0]
            return columns + (shown - own @ change)[..., None] * share

        return list(results(changed, zip(self.columns, self._beyond, self.projections, there, strict=True)))

    @property
    def exact(self) -> bool:
        """Whether `columns` are those of this point."""
        return self.derived is None

    def made_exact(self) -> FitPoint:
        """This point with derivatives of its own."""
        return self if self.derived is None else replace(self, derived=None)

    def holding(self, key: str, value: float) -> FitPoint:
        """A parameter held at a value, the others and the initial states where they then fit best, to first order.

        The derivatives are those of this point.

        :raises hydraulic_sim.errors.SimulationError: it does not run there.
        """
        own, information = self.parameters.keys.index(key), self.normal.information
        others = [i for i in range(len(self.parameters)) if i != own]
        change = np.zeros(len(self.parameters))
        change[own] = (value - self.parameters.values[own]) / self.parameters.scales[own]
        # Those that stay at a bound, or would go beyond, make this no worse a point to begin from.
        towards = self.normal.gradient[others] + information[others, own] * change[own]
        change[others] = -np.linalg.pinv(information[np.ix_(others, others)], rcond=1e-12, hermitian=True) @ towards
        parameters = self.parameters.moved(change)
        gone = (parameters.values - self.parameters.values) / self.parameters.scales
        shooting = replace(self.shooting, plant=self.shooting.plant.with_parameters({key: value}))
        ahead = [p.raw + c @ gone for p, c in zip(self.projections, self.columns, strict=True)]
        states = shooting.corrected(self.initial_states, self.projections, ahead)
        left = parameters.chosen(others)
        plant = shooting.plant.with_parameters(left.by_key)
        return replace(
            self, shooting=shooting, parameters=left, initial_states=states,
            projections=shooting.seen_from(self.projections, plant, states),
            derived=[c[..., others] for c in self.columns],
        )  # fmt: skip

    def with_columns_kept(self) -> FitPoint:
        """This point, its derivatives such as go with all that is made from it."""
        return replace(self, derived=self.columns)

    def with_new_directions(self, least: float) -> FitPoint:
        """This point, its directions of the initial states taken anew where they are old.

        :param least: of the sum of squares where they were taken, below which they are
        """
        if not self.cost < least * self.directions_cost:
            return self
        again = self.settled(self.shooting, self.parameters)
        return again if np.isfinite(again.cost) else self  # a run a little further off may leave all bounds

    def reweighted(self) -> FitPoint:
        """This point, or the same parameters with unmeasured pressures freer, where the model comes nearer."""
        misfit = _misfit(self.shooting.segments, [p.residual for p in self.projections])
        if misfit >= _NEARER * self.shooting.misfit:
            return self
        return self.settled(replace(self.shooting, misfit=misfit), self.parameters)

    def at_rest(self) -> FitPoint:
        """The same parameters, initial states moved on while that gains something."""
        point = self
        for _ in range(_ROUNDS):
            again = point.reweighted()
            if again is point:
                states = point.shooting.improved(point.plant, point.initial_states, point.projections)
                again = replace(point, initial_states=states[0], projections=states[1])
                if not again.cost < point.cost:
                    break
                if point.cost - again.cost < _SETTLED * point.cost:
                    point = again
                    break
            point = again
        return point.unstuck()

    def unstuck(self) -> FitPoint:
        """The same parameters, initial states of segments far off the others moved on in directions taken anew.

        One such segment changes the sum too little for `with_new_directions`, and old directions lead it nowhere. Each
        is tried from where it is and from where the record shows it. Of a model that is far off this says nothing: it
        leaves every segment an error of its own.
        """
        squares = [np.mean(p.residual**2, axis=1) for p in self.projections]
        usual = float(np.median(np.concatenate(squares)))
        if usual > _NEAR:
            return self
        chosen = [
            own > usual * (1.0 + _STUCK * np.sqrt(2.0 / p.raw.shape[1]))
            for own, p in zip(squares, self.projections, strict=True)
        ]
        if not any(c.any() for c in chosen):
            return self
        far = self.subset(chosen)
        own, anew = far._settled_on(far.initial_states), far._settled_on(far.shooting.initial_states)
        return self.with_subset(chosen, own.better_of(anew))

    def better_of(self, other: FitPoint) -> FitPoint:
        """The same parameters, each segment from that one of two points that leaves less of it."""
        better = [b < a for a, b in zip(self.costs, other.costs, strict=True)]
        return self.with_subset(better, other.subset(better))

    def _settled_on(self, initial_states: Sequence[Array]) -> FitPoint:
        """From these initial states on, in directions taken anew while that gains something in any segment."""
        point = self.settled(self.shooting, self.parameters, initial_states, _STUCK_SHARES)
        moving: list[Mask] = [np.ones(len(c), dtype=bool) for c in point.costs]
        for _ in range(_STUCK_ROUNDS):
            part = point.subset(moving)
            again = part.settled(part.shooting, part.parameters, None, _STUCK_SHARES)
            before, point = point.costs, point.with_subset(moving, again)
            moving = [a < (1.0 - _SETTLED) * b for b, a in zip(before, point.costs, strict=True)]
            if not any(m.any() for m in moving):
                break
        return point

    def with_subset(self, chosen: Sequence[Mask], point: FitPoint) -> FitPoint:
        """This point with initial states and residuals of ``point``, one of its subsets at the same parameters."""
        states, projections = list(self.initial_states), list(self.projections)
        used = [i for i, c in enumerate(chosen) if c.any()]
        for i, own, projection in zip(used, point.initial_states, point.projections, strict=True):
            states[i] = states[i].copy()
            states[i][chosen[i]] = own
            projections[i] = projections[i].with_subset(chosen[i], projection)
        return replace(self, initial_states=states, projections=projections)

    def subset(self, chosen: Sequence[Mask]) -> FitPoint:
        """On the ``chosen[i]`` (S_i,) segments of every record alone, without records of which there are none."""
        used = [(i, c) for i, c in enumerate(chosen) if c.any()]
        return replace(
            self,
            shooting=replace(self.shooting, segments=[self.shooting.segments[i].subset(c) for i, c in used]),
            initial_states=[self.initial_states[i][c] for i, c in used],
            projections=[self.projections[i].subset(c) for i, c in used],
            derived=None if self.derived is None else [self.derived[i][c] for i, c in used],
        )


@dataclass(frozen=True)
class Fit:
    """Where a fit ended."""

    point: FitPoint
    converged: bool
    iterations: int

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by key [SI]."""
        return self.point.parameters.by_key

    @property
    def cost(self) -> float:
        """Sum of squared residuals over noise."""
        return self.point.cost

    @property
    def rms(self) -> float:
        """Residual over noise as the loss counts it; 1 for an exact model, 0.96 with the robust loss."""
        return float(np.sqrt(self.cost / self._freedom))

    @property
    def spread(self) -> float:
        """What a residual adds to the parameters' uncertainty: `rms`, outliers bounded where the loss is robust."""
        if not self.point.robust:
            return self.rms
        residuals = [p.residual for p in self.point.projections]
        return float(np.sqrt(sum(np.sum((_weights(r) ** 2 * r) ** 2) for r in residuals) / self._freedom))

    @property
    def _freedom(self) -> int:
        """Each initial state takes one degree of freedom, and its prior gives it back."""
        measured = sum(int(s.counted.sum()) for s in self.point.shooting.segments)
        return max(measured - len(self.point.parameters), 1)


def fit(
    model: Model,
    records: Sequence[Record],
    keys: Sequence[str],
    settings: FitSettings | None = None,
    progress: Callable[[int, float], object] | None = None,
) -> Fit:
    """Fit the parameters ``keys`` of a model to records. ``progress`` gets each step's number and residual over noise.

    :raises CalibrationError: no records, or such as cannot be cut.
    :raises hydraulic_sim.errors.SimulationError: the model does not run along a record.
    """
    settings = settings or FitSettings()
    if not records:
        raise CalibrationError("there is no record to calibrate on")
    plant = Plant.for_fits(model)
    segments = cut(records, model.kind, settings.seconds(model, records), settings.robust)
    return fit_segments(plant, segments, keys, settings, progress)


def fit_segments(
    plant: Plant,
    segments: Sequence[Segments],
    keys: Sequence[str],
    settings: FitSettings,
    progress: Callable[[int, float], object] | None = None,
    priors: Priors = NO_PRIORS,
    starts: KnownStarts | None = None,
) -> Fit:
    """As `fit`, to segments that were cut before, with what is known of parameters and initial states beforehand."""
    begin = FitPoint.begin(plant, segments, keys, settings.robust, priors, starts)
    if not np.isfinite(begin.cost):
        raise SimulationError(f"{plant.model.name!r} leaves all bounds from where the records show its states")
    return fit_from(begin, settings, progress)


def fit_from(
    begin: FitPoint, settings: FitSettings, progress: Callable[[int, float], object] | None = None
) -> Fit:
    """As `fit`, from a point on that is known."""

    def accepted(number: int, point: FitPoint) -> FitPoint:
        if progress is not None:
            progress(number, float(np.sqrt(point.cost / max(sum(p.raw.size for p in point.projections), 1))))
        again = point.reweighted()
        return again if again is not point else point.with_new_directions(_OUTDATED)

    if not len(begin.parameters):
        return Fit(begin.at_rest(), True, 0)
    steps = 0
    while True:
        found: Minimum[FitPoint] = minimise(
            begin, settings.most_steps - steps, settings.least_gain, settings.tolerance, accepted=accepted
        )
        steps += found.iterations
        end = found.point.unstuck()
        outdated = _OUTDATED_AT_END * settings.least_gain
        begin = end.with_new_directions(1.0 - outdated)
        if steps >= settings.most_steps or (begin is end and end.cost > (1.0 - outdated) * found.point.cost):
            return Fit(end, found.converged, steps)


def evaluate(model: Model, records: Sequence[Record], settings: FitSettings | None = None) -> Fit:
    """Residuals of a model as it is: only the initial states of the segments are fitted."""
    return fit(model, records, (), settings)


def loss(residual: Array, robust: bool) -> Array:
    """What each residual over noise counts: its square, or if ``robust`` less from about three on (soft L1)."""
    if not robust:
        with np.errstate(over="ignore"):  # a run that leaves all bounds costs infinitely much
            return np.asarray(residual**2)
    return 2.0 * _MILD**2 * (np.sqrt(1.0 + (residual / _MILD) ** 2) - 1.0)


def _weights(residual: Array) -> Array:
    return np.asarray(1.0 / np.sqrt(1.0 + (residual / _MILD) ** 2))


def _misfit(segments: Sequence[Segments], residuals: Sequence[Array]) -> float:
    """How many times the noise the model is off, at least 1."""
    squares = sum(float(np.sum(s.by_channel(r) ** 2)) for s, r in zip(segments, residuals, strict=True))
    return max(1.0, float(np.sqrt(squares / sum(int(s.counted.sum()) for s in segments))))
