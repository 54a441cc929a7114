"""From what no effect of the library explains to a user effect: the place, the variable and the law that explain most.

First the curve that explains most is put in as a spline and fitted with all that is free, since a model that lacks
something is a bent one, and what is missing looks different from it. From there the law is taken (`laws`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from hydraulic_sysid.diagnosis.search.diagnosis import Remaining
from hydraulic_sysid.diagnosis.search.linearisation import Linearisation
from hydraulic_sysid.diagnosis.search.nonparametric import FILES
from hydraulic_sysid.diagnosis.search.nonparametric_curves import (
    NonparametricCurve,
    Place,
    curve_between,
    curve_normal,
    places,
    unexplained,
)
from hydraulic_sysid.estimation.fit import FitPoint, FitSettings, fit_segments
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations
from hydraulic_sysid.estimation.parameters import Priors

from .effect_file import effect_text
from .laws import FINE, PERIODIC, CurveEquations, FittedLaw, best_law

NEAR = 0.8  # of the reduction of the best curve, from which another is fitted too
MOST_FITTED = 2
CLEAR = 0.5  # of what noise does not explain, below which periodic laws are looked for too
PERIODIC_PLACES = (
    ("unknown_force", "position"), ("unknown_force", "time"), ("unknown_friction", "position"),
    ("unknown_supply", "time"), ("unknown_opening", "opening"), ("unknown_opening", "time"),
)  # fmt: skip
"""Where something may go round and round: threads and magnets, neighbouring machines, pumps, ports."""
LEAST = 0.5  # of what noise does not explain, which a law must explain to be worth a file
SHARES = (1.0, 0.3, 0.1)  # of a curve, from the best of which its fit begins: to first order it is often far too large
_FIRST = FitSettings(most_steps=8, least_gain=5e-3)
_USUAL = (0.01, 0.99)  # quantiles of a variable between which a spline has its knots
_EDGE = 0.02  # of the range of a variable, by which knots reach beyond it


@dataclass(frozen=True)
class ProposedEffect:
    """A user effect: the ``text`` of its file, where it acts, and what it explains.

    ``share``: of what noise does not explain on the segments looked at (0…1); ``beside``: effects that have to be on
    as well, as the diagnosis added them.
    """

    name: str
    text: str
    place: str
    subsystem: str
    variable: str
    law: str
    share: float
    beside: tuple[str, ...] = ()

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
        }


@dataclass(frozen=True)
class Candidate:
    """A place and variable with a law there, and by how much it lowers the sum of squares."""

    place: Place
    knots: Array
    fitted: FittedLaw

    @property
    def words(self) -> str:
        """The variable."""
        return self.place.variable.replace("_", " ")


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
    part, curves, beside = left.at, left.curves, left.beside
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for number, candidate in enumerate(_candidates(part, curves, say)[:MOST_FITTED]):
            say(f"fitting a curve over {candidate.words}")
            try:
                found.append(_fitted(part, candidate, Path(folder) / str(number) / f"{name}.py", records))
            except HydraulicError:  # the plant does not run with it
                continue
        if not found:
            return None
        first = min(found, key=lambda f: f.cost)
        share = min((_cost(part) - first.cost) / max(unexplained(part), 1e-300), 1.0)
        if share < LEAST:
            return None
        say(f"the law over {first.candidate.words}")
        final = _law(first) or first.candidate
    effect = final.place.effect
    evidence = (
        f"Of what the model leaves beyond the noise, such a curve over the {final.words} explains {percent(share)}, "
        f"all free parameters refitted. {_others(curves, final.place)}"
    )
    text = effect_text(
        effect, final.place.variable, final.fitted, _extent(final.place.values), evidence.strip(), records
    )
    law = final.fitted.law.name
    return ProposedEffect(name, text, effect.name, subsystem(effect), final.place.variable, law, share, tuple(beside))


def _candidates(
    part: Linearisation, curves: Sequence[NonparametricCurve], say: Callable[[str], None]
) -> list[Candidate]:
    """The best places with splines, the one that explains most first; those near it alone."""
    if not curves:
        return []
    wanted = {(c.place, c.variable) for c in curves[: 2 * MOST_FITTED]}
    periodic = set(PERIODIC_PLACES) if curves[0].share < CLEAR else set()
    found = []
    for place in places(part, lambda _: None):
        key = (place.effect.name, place.variable)
        if key in wanted:
            found.append(_candidate(part, place, FINE))
        if key in periodic:
            say(f"periodic laws over {place.variable}")
            found.append(_candidate(part, place, PERIODIC))
    every = sorted((c for c in found if c is not None), key=lambda c: -c.fitted.reduction)
    return [c for c in every if c.fitted.reduction >= NEAR * every[0].fitted.reduction]


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
    file.parent.mkdir()
    file.write_text(effect_text(place.effect, place.variable, fitted, _extent(place.values), "A first fit.", records))
    hat = [f for f in FILES if f.stem == place.effect.name]  # is needed when the law is taken: compiled once for both
    model = replace(part.model, user_effects=(*part.model.user_effects, *hat, file)).with_effect(name)
    own = [f"{name}.{p}" for p in (*fitted.law.coefficients, *fitted.law.shapes)]
    number = len(fitted.law.coefficients)
    keys, priors = (*part.parameters.keys, *own), _priors(part)
    model = begun(part, model, own[:number], keys, priors)
    done = fit_segments(Plant.for_fits(model), part.split.segments, keys, _FIRST, priors=priors)
    for key in own:
        model = model.with_entry(key, free=False)
    at = Linearisation.of(model.with_values(done.values, source="fitted"), part.split, priors)
    reached = [at.model.value(key) for key in own]
    now = replace(fitted, coefficients=np.array(reached[:number]), shape=tuple(reached[number:]))
    return _Fit(candidate, at, _cost(at), now.values(candidate.knots))


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


def _cost(at: Linearisation) -> float:
    return sum(float(c.sum()) for c in at.costs)


def _priors(part: Linearisation) -> Priors:
    p = part.parameters
    return {k: (float(m), float(s)) for k, m, s in zip(p.keys, p.mean, p.std, strict=True) if np.isfinite(s)}


def _law(fit: _Fit) -> Candidate | None:
    """The candidate with the law that explains most where it was fitted."""
    place, knots = fit.candidate.place, fit.candidate.knots
    every = places(fit.at, lambda _: None, (place.effect.name,))
    here = next((p for p in every if _key(p) == _key(place)), None)
    normal = None if here is None else curve_normal(fit.at, here, knots)
    if normal is None:
        return None
    # The curve as a whole, not what it still lacks: from where there is none.
    whole = fit.values / place.height.default
    none = NormalEquations(normal.information, ((normal.gradient - normal.information @ whole)[None],))
    best = best_law(_equations(fit.at, place, none, knots, fit.cost - normal.reduction(-whole)))
    return None if best is None else replace(fit.candidate, fitted=_in_units(best, place))


def _key(place: Place) -> tuple[str, str]:
    return place.effect.name, place.variable


def _extent(values: Array) -> tuple[float, float]:
    """The range of a variable, with a little on either side; one that has one sign keeps it."""
    low, high = float(values.min()), float(values.max())
    edge = _EDGE * (high - low)
    return (low if low >= 0.0 else low - edge), (high if high <= 0.0 else high + edge)


def _others(curves: Sequence[NonparametricCurve], chosen: Place) -> str:
    """What the next best curve was."""
    other = next((c for c in curves if (c.place, c.variable) != _key(chosen)), None)
    if other is None:
        return ""
    words = other.variable.replace("_", " ")
    return f"To first order the next best was {other.summary} over the {words} with {percent(other.share)}."
