"""Where something unknown acts: how much an addition of any course in time would explain at each place of the plant.

No law is assumed, so that none can be wrong: at one place after the other the model gets an input that may do anything,
and what that explains bounds what any law there may. A disturbance enters the measured channels with the dynamics of
its place (unknown inputs: Gillijns & De Moor, Automatica 43 (2007) 111-116), which is why several channels tell one
place from another. In each segment the course is a curve of its own, of linear B-splines over the time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.errors import SimulationError
from hydraulic_sysid.estimation.levenberg_marquardt import NormalEquations

from .candidates import subsystem
from .criteria import CRITERIA
from .linearisation import Linearisation
from .nonparametric_curves import Place, anywhere_allowed, places, unexplained

KNOTS = (6, 12, 24)  # in the length of a segment, the more where fewer do not tell one subsystem from all others
READS = "position_sensor"  # slot of the position's reading
_FAINT = 1e-6  # of the largest change that a course makes in a segment: one that changes less is none


@dataclass(frozen=True)
class UnknownInput:
    """An addition of any course at a ``place``; ``share`` (0…1) of what noise does not explain that it would."""

    place: str
    subsystem: str
    summary: str
    share: float


def unknown_inputs(at: Linearisation, say: Callable[[str], None]) -> list[UnknownInput]:
    """At every place of the plant, the one that would explain most first."""
    part, _ = at.sample(CRITERIA.enough_to_score)
    say("where an addition of any course may act")
    where = over_time(part)
    found = list[UnknownInput]()
    for knots in KNOTS:
        if found and _alone(found):
            break
        shares = [_share(part, place, knots) for place in where]
        if part.split.channels == ["position"]:
            # Its reading explains whatever it reads, and so no more than what explains most else.
            most = max((u for p, u in zip(where, shares, strict=True) if p.effect.slot != READS), default=0.0)
            shares = [min(u, most) for u in shares]
        found = [
            UnknownInput(p.effect.name, subsystem(p.effect), p.effect.summary, share)
            for p, share in zip(where, shares, strict=True)
        ]
        found.sort(key=lambda u: -u.share)
    return found


def _alone(found: Sequence[UnknownInput]) -> bool:
    """Whether the first explains nearly all, and what acts in other subsystems does not come near."""
    first, *rest = found
    others = max((u.share for u in rest if u.subsystem != first.subsystem), default=0.0)
    return first.share > CRITERIA.nearly and others < CRITERIA.nearly * first.share


@dataclass(frozen=True)
class Courses:
    """Hat functions over the time at a ``place``, ``width`` [s] apart, that begin again every ``period`` [s].

    ``columns``: per record what the height of each (K), of the default size, changes of the residuals (S, m, K) beyond
    what initial states do.
    """

    place: Place
    width: float
    period: float
    columns: Sequence[Array]

    @classmethod
    def of(cls, at: Linearisation, place: Place, knots: int) -> Courses | None:
        """So many in the length of a segment; None where the plant does not run with them."""
        name, length = place.effect.name, longest_segment(at)
        width = length / knots
        period = length + 2.0 * width  # more than a segment, which so sees every hat once
        courses = {"over": float(place.number), "width": width, "period": period, "centre": 0.0}
        hats = [courses | {"centre": k * width, "height": place.height.default} for k in range(knots + 3)]
        plants = [
            place.plant.with_parameters({f"{name}.{k}": v for k, v in hat.items()})
            for hat in (courses | {"height": 0.0}, *hats)
        ]
        try:
            changed = at.changes(plants)
        except SimulationError:
            return None
        return cls(place, width, period, at.point.beyond([c[..., 1:] - c[..., :1] for c in changed]))

    def times(self, begun: Array) -> Array:
        """When (S, K) [s] each of them is highest in segments that have ``begun`` (S,) then."""
        first = begun[:, None] - self.width
        return first + (self.width * np.arange(self.columns[0].shape[-1]) - first) % self.period


def longest_segment(at: Linearisation) -> float:
    """In seconds."""
    return max(s.samples * s.record.dt for s in at.split.segments)


def over_time(at: Linearisation) -> list[Place]:
    """The places of the plant where something of any course may act."""
    return [place for place in places(at) if place.variable == "time"]


def _share(at: Linearisation, place: Place, knots: int) -> float:
    """0 where the plant does not run with it."""
    courses = Courses.of(at, place, knots)
    if courses is None:
        return 0.0
    information = np.diag(at.parameters.prior_information + anywhere_allowed(at.parameters))
    scores, left, freedom = list[Array](), 0.0, 0
    for columns, residual, courses_here in zip(at.beyond, at.residual, courses.columns, strict=True):
        basis = _basis(courses_here)
        freedom += int(np.count_nonzero(basis.any(axis=1)))
        rest = _without(basis, residual[..., None])
        beyond = _without(basis, columns)
        information += np.tensordot(beyond, beyond, axes=([0, 1], [0, 1]))
        scores.append(np.einsum("smp,sm->sp", beyond, rest[..., 0]))
        left += float(np.sum(rest**2))
    normal = NormalEquations(information, tuple(scores), at.parameters.prior_gradient)
    change = -np.linalg.pinv(normal.information, rcond=1e-12, hermitian=True) @ normal.gradient
    total = sum(float(c.sum()) for c in at.costs)
    explained = total - (left - normal.reduction(change)) - freedom
    return min(max(explained / max(unexplained(at), 1e-300), 0.0), 1.0)


def _basis(columns: Array) -> Array:
    """Orthonormal directions (S, m, K) of columns (S, m, K), 0 in the place of those that hardly are any."""
    directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    most = sizes.max(axis=1, keepdims=True)
    return np.where((sizes > _FAINT * most) & (sizes > 0.0), 1.0, 0.0)[:, None, :] * directions


def _without(basis: Array, columns: Array) -> Array:
    """Columns (S, m, Q) beyond a basis (S, m, K)."""
    return columns - basis @ (np.swapaxes(basis, 1, 2) @ columns)
