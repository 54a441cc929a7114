"""What no library effect explains, as a curve without a law over the variable that explains most.

At every place of the plant where something may be added (`nonparametric`), and over every variable there, a curve of
linear B-splines is fitted to the residual: by the sensitivities to its coefficients beyond those of the free
parameters, so that the dynamics between the missing effect and the sensors is that of the
model and nothing is differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import Effect, Parameter
from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.plant import Plant
from hydraulic_sysid.diagnosis.locate.basis import lagged
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations
from hydraulic_sysid.estimation.parameters import Parameters
from hydraulic_sysid.estimation.segments import Segments

from .candidates import subsystem
from .criteria import CRITERIA
from .linearisation import Linearisation
from .nonparametric import FILES, WITH_MEMORY

KNOTS = 9
_RIDGE = 1e-6  # of the largest diagonal: knots that nothing visits
_VISITED = 1e-3  # of the largest information: a knot below is not shown
_RANGE = (0.005, 0.995)  # quantiles between which knots are laid
_WIDTH = 1.96  # standard errors on either side of a 95 % band


@dataclass(frozen=True)
class NonparametricCurve:
    """A curve: ``value`` (K,) ± ``error`` [``unit``] at ``knots`` (K,) [the variable's unit].

    ``reduction``: of the sum of squares on the segments looked at; ``share``: of what noise does not explain there.
    """

    place: str
    subsystem: str
    summary: str
    variable: str
    unit: str
    reduction: float
    share: float
    knots: Array
    value: Array
    error: Array


@dataclass(frozen=True)
class Place:
    """A place of the plant where something may be added, as ``effect`` adds a hat function, and a variable there.

    ``number``: the variable's among those of the effect; ``values``: what it takes in the records; ``shape``: values of
    the parameters that the effect has besides, as the ``lag`` of one that remembers.
    """

    plant: Plant
    effect: Effect
    number: int
    variable: str
    values: Array
    shape: Mapping[str, float] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, str]:
        """What names it."""
        return self.effect.name, self.variable

    @property
    def height(self) -> Parameter:
        """Of a hat function."""
        return next(p for p in self.effect.parameters if p.name == "height")


def nonparametric_curves(at: Linearisation, say: Callable[[str], None]) -> list[NonparametricCurve]:
    """All curves, the one that explains most first. Empty for a plant that takes none of them."""
    part, _ = at.sample(CRITERIA.enough_to_score)
    found = (curve(part, place) for place in places(part, say))
    return sorted((c for c in found if c is not None), key=lambda c: -c.reduction)


def places(
    at: Linearisation, say: Callable[[str], None] = lambda _: None, names: Container[str] | None = None
) -> Iterator[Place]:
    """Those that the plant has, with every variable that the records show and that moves.

    :param names: of the places that are asked for; fewer compile faster (default: all)
    """
    files = [f for f in FILES if names is None or f.stem in names]
    seen = _all_seen(at)
    for plant, effect in _extended(at, files, say):
        for number, variable in enumerate(effect.kernel.__globals__["VARIABLES"]):
            if all(variable in values for values in seen):
                yield Place(plant, effect, number, variable, np.concatenate([values[variable] for values in seen]))


def places_with_memory(
    at: Linearisation, lags: Iterable[float], say: Callable[[str], None] = lambda _: None
) -> Iterator[Place]:
    """Those over a variable that follows one of the motion late, with each of these time constants [s]."""
    tried, seen = list(lags), _all_seen(at)
    for plant, effect in _extended(at, WITH_MEMORY, say):
        (variable,) = effect.kernel.__globals__["VARIABLES"]
        follows = effect.kernel.__globals__["FOLLOWS"]
        for lag in tried:
            late = [lagged(v[follows], s.record.dt, lag) for v, s in zip(seen, at.split.segments, strict=True)]
            own = plant.with_parameters({f"{effect.name}.lag": lag})
            yield Place(own, effect, 0, variable, np.concatenate(late), {"lag": lag})


def _extended(at: Linearisation, files: Sequence[Path], say: Callable[[str], None]) -> Iterator[tuple[Plant, Effect]]:
    """The plant with each of these effects at the values of the fit, where it takes them.

    Of the library it has what is on: all of it would take long to compile.
    """
    others = (f for f in files if f not in at.model.user_effects)
    model = replace(at.model, user_effects=(*at.model.user_effects, *others), lean=True)
    for file in files:
        try:
            extended = model.with_effect(file.stem)
            extended.check_complete()
        except ModelError:  # the plant has no such stage
            continue
        say(f"curve of {model.library[file.stem].summary}")
        yield Plant(extended).with_parameters(at.parameters.by_key), model.library[file.stem]


def curve_normal(at: Linearisation, place: Place, knots: Array) -> NormalEquations | None:
    """Of the heights (K,) of hat functions at equally spaced ``knots`` (K,), over those of the height's default.

    The free parameters are eliminated, each as one that may be `anywhere_allowed`: what only they could undo, no curve
    may do. None where the plant does not run.
    """
    name, width = place.effect.name, float(knots[1] - knots[0])
    hats = [
        {"over": float(place.number), "centre": float(z), "width": width, "height": place.height.default} for z in knots
    ]
    try:
        changed = at.changes(
            [
                place.plant.with_parameters({f"{name}.{k}": v for k, v in hat.items()})
                for hat in ({"height": 0.0}, *hats)
            ]
        )
    except SimulationError:
        return None
    normal, own = at.bordered([c[..., 1:] - c[..., :1] for c in changed]), len(at.parameters)
    information = normal.information.copy()
    information[np.arange(own), np.arange(own)] += anywhere_allowed(at.parameters)
    return replace(normal, information=information).marginal(own)


def anywhere_allowed(parameters: Parameters) -> Array:
    """Information (P,) of being anywhere between bounds: the variance is a twelfth of their distance squared."""
    down, up = parameters.reach
    return 12.0 / (up - down) ** 2


def curve_between(
    at: Linearisation, place: Place, low: float, high: float, number: int
) -> tuple[Array, NormalEquations] | None:
    """So many knots between two values of the variable, and `curve_normal` there; None where there is no range."""
    if not high - low > 1e-9 * max(abs(low), abs(high), 1e-12):
        return None
    knots: Array = np.linspace(low, high, number, dtype=np.float64)
    normal = curve_normal(at, place, knots)
    return None if normal is None else (knots, normal)


def unexplained(at: Linearisation) -> float:
    """The sum of squares that noise does not explain."""
    noise = sum(float(r.size) - s.free.size * len(s) for r, s in zip(at.residual, at.split.segments, strict=True))
    return sum(float(c.sum()) for c in at.costs) - noise


def _seen(segments: Segments, limit: float) -> dict[str, Array]:
    """Values (N,) that the variables take in a record; ``limit`` [V] of the drive."""
    position, velocity, pressure_a, pressure_b = segments.smoothed.T
    record = segments.record
    opening = np.clip(record["drive"] / limit, -1.0, 1.0)
    values = {
        "position": position,
        "reading": position,
        "velocity": velocity,
        "speed": np.abs(velocity),
        "opening": opening,
        "size_of_opening": np.abs(opening),
        "time": np.arange(len(record)) * record.dt,
    }
    if np.isfinite(segments.smoothed).all():
        difference = pressure_a - pressure_b
        values |= {"pressure_a": pressure_a, "pressure_b": pressure_b, "mean_pressure": 0.5 * (pressure_a + pressure_b)}
        values |= {"pressure_difference": difference, "size_of_pressure_difference": np.abs(difference)}
    return values


def _all_seen(at: Linearisation) -> list[dict[str, Array]]:
    limit = at.model.value("drive_limit")
    return [_seen(segments, limit) for segments in at.split.segments]


def curve(at: Linearisation, place: Place) -> NonparametricCurve | None:
    """Of so many `KNOTS` there; None where the plant does not run, or nothing visits them."""
    low, high = (float(np.quantile(place.values, q)) for q in _RANGE)
    laid = curve_between(at, place, low, high, KNOTS)
    if laid is None:
        return None
    knots, normal = laid
    visited = np.diag(normal.information)
    ridge = _RIDGE * float(visited.max())
    if not ridge > 0.0:
        return None
    inverse = np.linalg.inv(normal.information + ridge * np.eye(KNOTS))
    value = -inverse @ normal.gradient
    reduction = normal.reduction(value)
    total = sum(float(c.sum()) for c in at.costs)
    spread = max(1.0, np.sqrt(total / sum(r.size for r in at.residual)))
    error = np.sqrt(np.maximum(np.diag(inverse), 0.0)) * spread
    shown = visited > _VISITED * float(visited.max())
    size = place.height.default
    return NonparametricCurve(
        place.effect.name,
        subsystem(place.effect),
        place.effect.summary,
        place.variable,
        place.height.unit,
        reduction,
        min(reduction / max(unexplained(at), 1e-300), 1.0),
        knots[shown],
        value[shown] * size,
        _WIDTH * error[shown] * size,
    )
