"""Whether an effect is worth its place: what it must explain, beside which others, and what makes it superfluous."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hydraulic_sim.errors import SimulationError

from .candidates import observed, subsystem
from .competing_models import competing_models
from .criteria import CRITERIA
from .misfit import Misfit, explained, material
from .search_state import SearchResult, SearchState
from .uncertainty import may_be_nothing

Enough = Callable[[str, Misfit, float], bool]


def enough_at_first(base: SearchState, name: str, after: Misfit, part: float) -> bool:
    """Whether a first effect explains a good part of what the model, within its tolerances, leaves."""
    return explained(base.misfit, after) >= part * CRITERIA.further


def worth_adding(
    base: SearchState, before: SearchState, added: Sequence[str], name: str, after: Misfit, part: float
) -> bool:
    """Whether a further effect explains enough (times ``part``).

    That is a good part of what is left, or something of what there was, where the others explain most of it. What
    explains little where most is left would be a proxy.
    """
    if absorbs_discrepancy(base, before, added, name, after, part):
        return False
    if explained(before.misfit, after) >= part * CRITERIA.further:
        return True
    most = explained(base.misfit, before.misfit) >= CRITERIA.hopeless
    return most and explained(base.misfit, after) - explained(base.misfit, before.misfit) >= part * CRITERIA.needed


def absorbs_discrepancy(
    base: SearchState, before: SearchState, others: Sequence[str], name: str, after: Misfit, part: float = 1.0
) -> bool:
    """Whether an effect explains so little of all that it may only absorb the discrepancy of the others' laws.

    One of another subsystem that explains most of what is left is believed.
    """
    library = base.model.library
    alike = any(subsystem(library[name]) == subsystem(library[other]) for other in others)
    if not alike and explained(before.misfit, after) >= part * CRITERIA.hopeless:
        return False
    least = part * (CRITERIA.law**2 if alike else CRITERIA.law_elsewhere)
    return before.misfit.total - after.total < least * (base.misfit.total - after.total)


def superfluous(base: SearchState, without: SearchState, state: SearchState, name: str, others: Sequence[str]) -> bool:
    """Whether ``state`` is hardly better than ``without`` the effect."""
    if not material(without.misfit, state.misfit) or absorbs_discrepancy(base, without, others, name, state.misfit):
        return True
    lost = without.misfit.total - state.misfit.total
    needed = CRITERIA.needed * (base.misfit.total - state.misfit.total)
    return explained(without.misfit, state.misfit) < CRITERIA.further and lost < needed


def near_competitors(base: SearchState, without: SearchState, state: SearchState, name: str) -> SearchState:
    """The state ``without`` an effect, and of its refits those that come near the state with it."""
    if explained(base.misfit, state.misfit) < CRITERIA.hopeless:
        return replace(without, refits=[])
    far = CRITERIA.rough * (without.misfit.total - state.misfit.total)
    short = [CRITERIA.stops_short * (r.misfit.excess - state.misfit.excess) for r in without.refits if r.name == name]
    left = state.misfit.excess + max([far, *short])
    return replace(without, refits=[r for r in without.others(name) if r.misfit.excess < left])


def without_competitor(base: SearchState, final: SearchState, name: str) -> bool:
    """Whether an effect explains by itself most of what is off, and no other candidate comes near it.

    That is judged by what they explain or, where in the end all is explained, by what they leave.
    """
    own = next((r.misfit for r in base.refits if r.name == name), None)
    if own is None or base.misfit.total - own.total < CRITERIA.nearly * base.misfit.excess:
        return False
    others = [r.misfit for r in base.others(name)]
    alone = all(base.misfit.total - at.total < CRITERIA.most_of * (base.misfit.total - own.total) for at in others)
    little = final.misfit.variance < CRITERIA.little**2
    return alone or (little and all(at.excess > CRITERIA.far * (own.excess + at.least) for at in others))


def anything(name: str, after: Misfit, part: float) -> bool:
    """No more is asked than that a reduction is one."""
    return True


def borrowed(before: SearchState, after: SearchState, name: str) -> bool:
    """Whether an effect leaves hardly more where it vanishes, everything else being as it is: its gain is not its own.

    A contact that swings fast has the plant integrated in shorter steps, even where nothing hangs on it. What is left
    without an effect can only be less once all is fitted anew, so that what is its own comes back in full. Rounding
    stays out of both: it has no derivative, and its noise is too small for what is left without it.
    """
    effect = after.model.library[name]
    if observed(effect):  # it stands beside the linearisation
        return False
    point = after.linearisation.point
    vanished = {f"{name}.{p.name}": p.null for p in effect.parameters if p.null is not None}
    try:
        without = point.shooting.seen_from(
            point.projections, point.plant.with_parameters(vanished), point.initial_states
        )
    except SimulationError:  # it does not run without it
        return False
    back = sum(float(np.sum(new.costs - old)) for new, old in zip(without, point.costs, strict=True))
    return back < CRITERIA.most_of * (before.linearisation.point.cost - point.cost)


def leaves_most(before: Misfit, after: Misfit, nothing: bool = False) -> bool:
    """Whether nothing need be missing, and much of what was left before still is.

    So little is left that it may be the noise, or, whatever the sensors show, it is ``nothing`` to anybody.
    """
    left = max(CRITERIA.small_unexplained * (before.usual - 1.0), CRITERIA.nothing_left)
    return (before.little or nothing) and after.usual - 1.0 > left


def nothing_gained(before: Misfit, after: Misfit) -> bool:
    """Whether nothing was left before, and effects take nothing off what noise leaves that anybody would see.

    Segments may agree on it: rounding looks like a resonance to a small light piston.
    """
    gain = before.total - after.total
    seen = after.squares < (1.0 - CRITERIA.seen) ** 2 * before.squares
    return before.usual - 1.0 < CRITERIA.nothing_left and (gain < CRITERIA.promises * before.least or not seen)


def decisive(found: SearchResult) -> SearchResult:
    """A search without the effects that its data do not name.

    None where they take nothing off what was left (they did while noise was judged without them), or nothing was left
    before (a converter's steps, whose size every record shows, below its noise), or so little that nothing need be
    missing and they leave much of that; no further one without which nothing is left either, none that explains little
    and may as well be something of another subsystem: that is how far laws are off those of the bench; and none on
    whose size segments disagree by more than it is.
    """
    base, final = found.base.misfit, found.final.misfit
    vain = not material(base, final) or nothing_gained(base, final)
    if found.added and (vain or leaves_most(base, final, found.base.immaterial)):
        return replace(found, final=found.base, misfits={}, competing={})
    for name in reversed(found.added[1:]):
        effect = found.model.library[name]
        if needless(found, name) or vague(found, name) or may_be_nothing(found.final.linearisation, effect):
            misfits = {other: misfit for other, misfit in found.misfits.items() if other != name}
            competing = {other: state for other, state in found.competing.items() if other != name}
            without = found.competing[name]
            misfits[next(reversed(misfits))] = without.misfit
            return decisive(replace(found, final=without, misfits=misfits, competing=competing))
    return found


def needless(found: SearchResult, name: str) -> bool:
    """Whether nothing is left without an effect, either; what the records show by themselves is there all the same.

    A noise that was judged without it has it in itself: then it counts what the effect leaves.
    """
    without = found.competing.get(name)
    if without is None or without is found.base or observed(found.model.library[name]):
        return False
    noise = min(found.final.misfit.squares, float(without.misfit.count))
    return without.misfit.squares - noise < CRITERIA.nothing_left * without.misfit.count


def vague(found: SearchResult, name: str) -> bool:
    """Whether an effect explains little of all, and no more than something of another subsystem would."""
    base, final, library = found.base.misfit, found.final.misfit, found.model.library
    without = found.competing.get(name)
    if without is None or without is found.base:
        return False
    share = (without.misfit.total - final.total) / max(base.total - final.total, 1e-9)
    others = [c.name for c in competing_models(name, without, final) if not c.distinguishable]
    own = subsystem(library[name])
    return share < CRITERIA.subordinate and any(subsystem(library[other]) != own for other in others)
