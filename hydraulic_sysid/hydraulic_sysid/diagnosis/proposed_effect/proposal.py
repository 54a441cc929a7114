"""From what no effect of the library explains to a user effect: the place, the variable and the law that explain most.

First the curve that explains most is put in as a spline and fitted with all that is free, since a model that lacks
something is a bent one, and what is missing looks different from it. From there the law is taken (`laws`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.display import percent
from hydraulic_sysid.diagnosis.search.candidates import subsystem
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA
from hydraulic_sysid.diagnosis.search.diagnosis import Remaining
from hydraulic_sysid.diagnosis.search.force_balance import drives_by_force
from hydraulic_sysid.diagnosis.search.force_curves import ForceCurve, Forces
from hydraulic_sysid.diagnosis.search.linearisation import Linearisation
from hydraulic_sysid.diagnosis.search.nonparametric import FILES, WITH_MEMORY
from hydraulic_sysid.diagnosis.search.nonparametric_curves import (
    NonparametricCurve,
    Place,
    curve,
    curve_between,
    curve_normal,
    places,
    places_with_memory,
    unexplained,
)
from hydraulic_sysid.diagnosis.search.whereabouts import Whereabouts
from hydraulic_sysid.estimation.fit import FitPoint, FitSettings, fit_segments
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations
from hydraulic_sysid.estimation.parameters import Priors

from .effect_file import effect_text
from .laws import FINE, PERIODIC, CurveEquations, FittedLaw, best_law, spline

NEAR = 0.8  # of the reduction of the best curve, from which another is fitted too
MOST_FITTED = 3
CLEAR = 0.5  # of what noise does not explain, below which periodic laws are looked for too
PERIODIC_PLACES = (
    ("unknown_force", "position"), ("unknown_force", "time"), ("unknown_friction", "position"),
    ("unknown_supply", "time"), ("unknown_opening", "opening"), ("unknown_opening", "time"),
)  # fmt: skip
"""Where something may go round and round: threads and magnets, neighbouring machines, pumps, ports."""
HOLDS = 0.9  # of what a curve explains, which a law taken from it must explain as it is: else the curve is written
LEAST = 0.5  # of what noise does not explain, which a law must explain to be worth a file
PLENTY = 0.8
"""Of what noise does not explain: a curve that explains so much ends the search for others, …"""
ALL = 0.95  # … but for one over the time, as what drifts may look like a law of the motion
CLEARLY = 0.5  # of what a law leaves, below which such a curve is taken instead
LAGS = (2.0, 8.0, 32.0)  # sampling intervals by which it may follow, to begin with
FORCE_LAGS = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # likewise, where nothing is simulated
FORCES, MOTION = ("unknown_force", "unknown_friction"), ("position", "velocity", "speed")
"""Where forces are, and over what they may be where the drive that answers to them is the force."""
SHARES = (1.0, 0.3, 0.1)  # of a curve, from the best of which its fit begins: to first order it is often far too large
_FORCE_KNOTS = 9
_SHOWN = 101  # places at which a document has a law
_FIRST = FitSettings(most_steps=8, least_gain=5e-3)
_USUAL = (0.01, 0.99)  # quantiles of a variable between which a spline has its knots
_EDGE = 0.02  # of the range of a variable, by which knots reach beyond it


@dataclass(frozen=True)
class ProposedEffect:
    """A user effect: the ``text`` of its file, where it acts, and what it explains.

    ``share``: of what noise does not explain on the segments looked at (0…1); ``beside``: effects that have to be on
    as well, as the diagnosis added them; ``value`` (N,) [``unit``] of the law at ``knots`` (N,) [the variable's unit],
    which follows the motion ``lag`` [s] late.
    """

    name: str
    text: str
    place: str
    subsystem: str
    variable: str
    law: str
    share: float
    beside: tuple[str, ...]
    summary: str
    unit: str
    lag: float
    knots: Array
    value: Array

    @property
    def row(self) -> dict[str, Any]:
        """What a document says of it."""
        return {
            "name": self.name,
            "place": self.place,
            "subsystem": self.subsystem,
            "variable": self.variable,
            "law": self.law,
            "explained_share": self.share,
            "beside": list(self.beside),
            "summary": self.summary,
            "unit": self.unit,
            "lag": self.lag,
            "knots": self.knots,
            "value": self.value,
        }


@dataclass(frozen=True)
class Candidate:
    """A place and variable with a law there, and by how much it lowers the sum of squares.

    ``beside``: values of free parameters that belong to it.
    """

    place: Place
    knots: Array
    fitted: FittedLaw
    beside: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """The variable."""
        return self.place.variable.replace("_", " ")

    @property
    def over_time(self) -> bool:
        """Whether it is no law: it only says when."""
        return self.place.variable == "time" and self.fitted.law.name != "periodic"


@dataclass(frozen=True)
class _Fit:
    """A candidate that was put into the model and fitted: where, and the sum of squares that it leaves."""

    candidate: Candidate
    at: Linearisation
    cost: float
    values: Array
    """Of the curve (M,) at the candidate's knots."""


def propose(
    left: Remaining, name: str, records: Sequence[str], say: Callable[[str], None] = lambda _: None
) -> ProposedEffect | None:
    """The effect that explains most of what is left; None where none explains half of it.

    :param name: of the effect, which is that of its file
    :param records: names of those that it is learned from
    """
    part, where, beside = left.at, left.where, left.beside
    with tempfile.TemporaryDirectory() as folder:
        found = list[_Fit]()

        def explained(share: float) -> bool:
            return any(_explained(part, f) > share for f in found)

        for number, candidate in enumerate(_worth_fitting(part, where, explained, say)):
            say(f"fitting a curve over {candidate.words}")
            with suppress(HydraulicError):  # the plant does not run with it
                found.append(_fitted(part, candidate, Path(folder) / str(number) / f"{name}.py", records))
        if not found:
            return None
        first = _best(part, found)
        share = min(_explained(part, first), 1.0)
        if share < LEAST:
            return None
        say(f"the law over {first.candidate.words}")
        final = _law(first)
        if final is None or not holds(part, first, final, Path(folder) / "law" / f"{name}.py", records):
            final = first.candidate
    effect = final.place.effect
    evidence = (
        f"Of what the model leaves beyond the noise, such a curve over the {final.words} explains {percent(share)}, "
        f"all free parameters refitted. {_others(where.curves, final.place)}"
    )
    place, fitted, extent = final.place, final.fitted, _extent(final.place.values)
    knots = np.linspace(*extent, _SHOWN, dtype=np.float64)
    return ProposedEffect(
        name, effect_text(place, fitted, extent, evidence.strip(), records), effect.name, subsystem(effect),
        place.variable, fitted.law.name, share, tuple(beside), effect.summary, place.height.unit,
        place.shape.get("lag", 0.0), knots, fitted.values(knots),
    )  # fmt: skip


def _best(part: Linearisation, found: Sequence[_Fit]) -> _Fit:
    """The one that leaves least; one over the time only if it leaves less than half of what any other does."""
    laws = [f for f in found if not f.candidate.over_time]
    first = min(found, key=lambda f: f.cost)
    if first.candidate.over_time and laws:
        other = min(laws, key=lambda f: f.cost)
        return first if 1.0 - _explained(part, first) < CLEARLY * (1.0 - _explained(part, other)) else other
    return first


def _worth_fitting(
    part: Linearisation, where: Whereabouts, explained: Callable[[float], bool], say: Callable[[str], None]
) -> Iterator[Candidate]:
    """Curves that are fitted one after the other, until one has ``explained`` so much."""

    def until(share: float, candidates: Iterable[Candidate]) -> Iterator[Candidate]:
        for candidate in candidates:
            if explained(share):
                return
            yield candidate

    by_force = drives_by_force(part.model)
    if by_force:
        say("curves of the force that the motion asks for")
        yield from until(PLENTY, _by_force(part))
        if explained(PLENTY):
            return
    every = _candidates(part, where, say)
    yield from until(PLENTY, [c for c in every if not c.over_time][:MOST_FITTED])
    yield from until(ALL, [c for c in every if c.over_time][:1])
    late = None if by_force or explained(PLENTY) else _with_memory(part, say)
    if late is not None:
        yield late


def _by_force(part: Linearisation) -> list[Candidate]:
    """The best curves over the motion as it is and as it was, by the forces that records ask for."""
    forces = Forces.of(part.model, part.parameters, part.split.segments)
    if forces is None:
        return []
    kinds = (
        [p for p in places(part, names=FORCES) if p.variable in MOTION],
        list(places_with_memory(part, _lags(part, FORCE_LAGS))),
    )
    best = [max((_curve_by_force(forces, p) for p in kind), key=lambda c: c.share) for kind in kinds if kind]
    return [
        Candidate(c.place, c.knots, FittedLaw(spline(len(c.knots)), c.heights, (), c.share, 0.0, c.knots), c.values)
        for c in sorted(best, key=lambda c: -c.share)
    ]


def _curve_by_force(forces: Forces, place: Place) -> ForceCurve:
    low, high = (float(np.quantile(place.values, q)) for q in _USUAL)
    return forces.curve(place, np.linspace(low, high, _FORCE_KNOTS, dtype=np.float64))


def _candidates(part: Linearisation, where: Whereabouts, say: Callable[[str], None]) -> list[Candidate]:
    """The best places with splines, the one that explains most first; those near it and those at a known place alone.

    What a curve explains is known to first order only, and the place better than the variable.
    """
    curves, known = where.curves, where.place
    if not curves:
        return []
    wanted = {(c.place, c.variable) for c in [*curves[: MOST_FITTED + 1], *(c for c in curves if c.place == known)]}
    periodic = set(PERIODIC_PLACES) if curves[0].share < CLEAR else set()
    found = []
    for place in places(part):
        if place.key in wanted:
            found.append(_candidate(part, place, FINE))
        if place.key in periodic:
            say(f"periodic laws over {place.variable}")
            found.append(_candidate(part, place, PERIODIC))
    every = sorted((c for c in found if c is not None), key=lambda c: -c.fitted.reduction)
    least = NEAR * every[0].fitted.reduction if every else 0.0
    return [c for c in every if c.fitted.reduction >= least or c.place.effect.name == known]


def _with_memory(part: Linearisation, say: Callable[[str], None]) -> Candidate | None:
    """The best place for a curve that remembers."""
    sample, _ = part.sample(CRITERIA.enough_to_score)
    rough = [(curve(sample, place), place) for place in places_with_memory(sample, _lags(part, LAGS), say)]
    found = [(c.reduction, number) for number, (c, _) in enumerate(rough) if c is not None]
    return _candidate(part, rough[max(found)[1]][1], FINE) if found else None


def _lags(part: Linearisation, samples: Sequence[float]) -> list[float]:
    """So many sampling intervals [s], of the record with the shortest."""
    return [n * min(s.record.dt for s in part.split.segments) for n in samples]


def _candidate(part: Linearisation, place: Place, number: int) -> Candidate | None:
    laid = curve_between(part, place, *_extent(place.values), number)
    if laid is None:
        return None
    knots, normal = laid
    fitted = best_law(_equations(part, place, normal, knots, _cost(part)), short=number == PERIODIC)
    return None if fitted is None else Candidate(place, knots, _in_units(fitted, place))


def _equations(
    part: Linearisation, place: Place, normal: NormalEquations, knots: Array, total: float
) -> CurveEquations:
    low, high = (float(np.quantile(place.values, q)) for q in _USUAL)
    return CurveEquations(normal, knots, (low, high), total, sum(r.size for r in part.residual))


def _in_units(fitted: FittedLaw, place: Place) -> FittedLaw:
    return replace(fitted, coefficients=fitted.coefficients * place.height.default)


def _fitted(part: Linearisation, candidate: Candidate, file: Path, records: Sequence[str]) -> _Fit:
    """A candidate's law in the model, fitted with all else that is free, and held there."""
    place, fitted, name = candidate.place, candidate.fitted, file.stem
    # The hat function is needed when the law is taken: compiled once for both.
    hat = [f for f in (*FILES, *WITH_MEMORY) if f.stem == place.effect.name]
    model = _with_law(part, candidate, file, records, hat)
    own = [f"{name}.{p}" for p in (*fitted.law.coefficients, *fitted.law.shapes, *place.shape)]
    number = len(fitted.law.coefficients)
    keys, priors = (*part.parameters.keys, *own), _priors(part)
    model = begun(part, model.with_values(candidate.beside), own[:number], keys, priors)
    done = fit_segments(Plant.for_fits(model), part.split.segments, keys, _FIRST, priors=priors)
    for key in own:
        model = model.with_entry(key, free=False)
    at = Linearisation.of(model.with_values(done.values, source="fitted"), part.split, priors)
    reached = [at.model.value(key) for key in own]
    end = number + len(fitted.shape)
    now = replace(fitted, coefficients=np.array(reached[:number]), shape=tuple(reached[number:end]))
    there = replace(place, shape=dict(zip(place.shape, reached[end:], strict=True)))
    return _Fit(replace(candidate, place=there, fitted=now), at, _cost(at), now.values(candidate.knots))


def holds(part: Linearisation, fit: _Fit, law: Candidate, file: Path, records: Sequence[str]) -> bool:
    """Whether a law that was taken from a fitted curve explains in the model `HOLDS` of what the curve does."""
    keys = part.parameters.keys
    model = _with_law(part, law, file, records).with_values({key: fit.at.model.value(key) for key in keys})
    try:
        begin = FitPoint.begin(Plant.for_fits(model), part.split.segments, keys, priors=_priors(part))
    except HydraulicError:  # it does not run
        return False
    return _cost(part) - begin.cost > HOLDS * (_cost(part) - fit.cost)


def _with_law(
    part: Linearisation, candidate: Candidate, file: Path, records: Sequence[str], others: Sequence[Path] = ()
) -> Model:
    """The model with a candidate's law on, written to a ``file``; its library, a lean one, has ``others`` as well."""
    place = candidate.place
    file.parent.mkdir()
    file.write_text(effect_text(place, candidate.fitted, _extent(place.values), "On trial.", records))
    files = (*part.model.user_effects, *others, file)
    return replace(part.model, user_effects=files, lean=True).with_effect(file.stem)


def begun(part: Linearisation, model: Model, heights: Sequence[str], keys: Sequence[str], priors: Priors) -> Model:
    """The model with that part of its curve that leaves least.

    :raises hydraulic_sim.errors.SimulationError: it does not run with any.
    """
    costs, why = dict[float, float](), SimulationError("no part of the curve was tried")
    models = {share: model.with_values({k: share * model.value(k) for k in heights}) for share in SHARES}
    for share, one in models.items():
        try:
            costs[share] = FitPoint.begin(Plant.for_fits(one), part.split.segments, keys, priors=priors).cost
        except SimulationError as error:
            why = error
    if not costs:
        raise why
    return models[min(costs, key=lambda share: costs[share])]


def _explained(part: Linearisation, fit: _Fit) -> float:
    """Of what noise does not explain, the share that a fitted curve does."""
    return (_cost(part) - fit.cost) / max(unexplained(part), 1e-300)


def _cost(at: Linearisation) -> float:
    return sum(float(c.sum()) for c in at.costs)


def _priors(part: Linearisation) -> Priors:
    p = part.parameters
    return {k: (float(m), float(s)) for k, m, s in zip(p.keys, p.mean, p.std, strict=True) if np.isfinite(s)}


def _law(fit: _Fit) -> Candidate | None:
    """The candidate with the law that explains most where it was fitted."""
    place, knots = fit.candidate.place, fit.candidate.knots
    if place.shape:
        every = places_with_memory(fit.at, place.shape.values())
    else:
        every = places(fit.at, names=(place.effect.name,))
    here = next((p for p in every if p.key == place.key), None)
    normal = None if here is None else curve_normal(fit.at, here, knots)
    if normal is None:
        return None
    # The curve as a whole, not what it still lacks: from where there is none.
    whole = fit.values / place.height.default
    none = NormalEquations(normal.information, ((normal.gradient - normal.information @ whole)[None],))
    best = best_law(_equations(fit.at, place, none, knots, fit.cost - normal.reduction(-whole)))
    return None if best is None else replace(fit.candidate, fitted=_in_units(best, place))


def _extent(values: Array) -> tuple[float, float]:
    """The range of a variable, with a little on either side; one that has one sign keeps it."""
    low, high = float(values.min()), float(values.max())
    edge = _EDGE * (high - low)
    return (low if low >= 0.0 else low - edge), (high if high <= 0.0 else high + edge)


def _others(curves: Sequence[NonparametricCurve], chosen: Place) -> str:
    """What the next best curve was."""
    other = next((c for c in curves if (c.place, c.variable) != chosen.key), None)
    if other is None:
        return ""
    words = other.variable.replace("_", " ")
    return f"To first order the next best was {other.summary} over the {words} with {percent(other.share)}."
