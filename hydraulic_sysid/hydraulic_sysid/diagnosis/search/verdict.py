"""From figures to one of four verdicts, and its sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record

from .candidates import candidates
from .rivals import Rival
from .search import Found
from .shape import Shape

MISSING = "missing"
TIED = "indistinguishable"
COMPLETE = "complete"
OUTSIDE = "outside the library"

UNSEEN = 0.015  # mean square beyond the noise that a noise floor estimated from data may miss
UNEXPLAINED = 0.2  # of what was to be explained: more than that left is no matter of a law's details
SMALL = 1.2  # mean square over noise below which more may be left …
SMALL_UNEXPLAINED = 0.4  # … namely this share
STRAINED = 0.01  # the same where an effect fits only with its shape at the end of what is physical
LARGE = 1.03  # residual over noise from which something is missing although no effect of the library is


def alike(model: Model, added: Sequence[str], channels: Sequence[str]) -> dict[str, list[str]]:
    """Effects found → those that these channels cannot tell from them, however well one of them fits.

    Without pressures a family of effects acts alike on the position, up to parameters that no record shows.
    """
    if model.kind != "hydraulic" or any(c.startswith("pressure_") for c in channels):
        return {}
    off = [e for e in candidates(model) if e.alike_without_pressures]
    found = {}
    for name in added:
        family = model.library[name].alike_without_pressures
        same = [e.name for e in off if family and e.alike_without_pressures == family and e.name not in added]
        if same:
            found[name] = same
    return found


def left_over(found: Found) -> float:
    """Mean square beyond the noise, over that before anything was added (0…1)."""
    base, final = found.base.level, found.final.level
    seen = max(base.variance - 1.0 - UNSEEN, 0.0)
    left = max(final.variance - 1.0 - UNSEEN, 0.0)
    return left / seen if seen > 0.0 else 0.0


def kind_of(
    found: Found, rivals: Mapping[str, Sequence[Rival]], family: Mapping[str, Sequence[str]] | None = None
) -> str:
    """The verdict's kind."""
    final = found.final.level
    if not found.added:
        return OUTSIDE if final.variance > LARGE**2 else COMPLETE
    allowed = STRAINED if strained(found) else SMALL_UNEXPLAINED if final.variance < SMALL else UNEXPLAINED
    if left_over(found) > allowed and final.variance > 1.0 + 2.0 * UNSEEN:
        return OUTSIDE
    return TIED if family or any(not r.told_apart for every in rivals.values() for r in every) else MISSING


def strained(found: Found) -> list[str]:
    """Shape parameters of effects found that ended at a bound: the law had to be bent to its limits to fit."""
    model = found.final.model
    keys = []
    for name in found.added:
        for p in model.library[name].parameters:
            key = f"{name}.{p.name}"
            low, high = model.entry(key).bounds or p.bounds
            near = 1e-6 * max(abs(p.default), 1e-12)
            if p.null is None and p.free and not low + near < model.value(key) < high - near:
                keys.append(key)
    return keys


def same_as(name: str, rivals: Mapping[str, Sequence[Rival]], family: Mapping[str, Sequence[str]] | None) -> list[str]:
    """What cannot be told from an effect that was found: by the errors, or by the channels."""
    tied = [r.name for r in rivals.get(name, ()) if not r.told_apart]
    return list(dict.fromkeys([*tied, *(family or {}).get(name, ())]))


def sentences(
    found: Found,
    rivals: Mapping[str, Sequence[Rival]],
    kind: str,
    shapes: Sequence[Shape],
    family: Mapping[str, Sequence[str]] | None = None,
) -> str:
    """What a user reads first."""
    base, final = found.base.level.rms_held_out, found.final.level.rms_held_out
    fell = f"On held-out data the residual went from {base:.3g} to {final:.3g} times the noise."
    if kind == COMPLETE:
        return (
            f"Complete: on held-out data the residual is {final:.3g} times the noise, and no effect of the library "
            "lowers it by more than chance."
        )
    if kind == MISSING:
        return f"Missing: {_and(found.added)}. {fell} {_why_not(found, rivals)}".strip()
    if kind == TIED:
        parts = []
        for name in found.added:
            same = same_as(name, rivals, family)
            parts.append(f"one of {{{', '.join([name, *same])}}}" if same else name)
        why = " Pressures would: without them these act alike on the position." if family else ""
        return (
            f"Missing: {_and(parts)}; these data cannot tell {'them' if len(parts) == 1 else 'all'} apart. {fell}{why}"
        )
    text = "Outside the library: something is left that no effect of it explains. "
    if found.added:
        text += f"The nearest is {_and(found.added)}. {fell} "
    else:
        text += f"On held-out data the residual is {final:.3g} times the noise. "
    if shapes:
        best = shapes[0]
        text += (
            f"It looks like {best.summary} over {best.variable.replace('_', ' ')}, which would explain "
            f"{100 * best.share:.0f} % of what is left."
        )
    return text.strip()


def imitated(records: Sequence[Record]) -> list[str]:
    """Effects that the amplifier or valve itself imitates, as it said when the records were made."""
    found: set[str] = set()
    for record in records:
        plant = record.description.get("plant")
        if isinstance(plant, Mapping):
            found |= {str(name) for name in plant.get("imitated_effects", ())}
    return sorted(found)


def warning(named: Sequence[str], imitations: Sequence[str]) -> str:
    """What to look at before the hydraulics are blamed; empty where nothing is imitated."""
    both = [name for name in named if name in imitations]
    if both:
        return (
            f" The devices on the bus are set so that they imitate {_and(both)}: read those settings first (inspect)."
        )
    if imitations:
        return f" The devices on the bus are set so that they imitate {_and(list(imitations))}."
    return ""


def _why_not(found: Found, rivals: Mapping[str, Sequence[Rival]]) -> str:
    parts = []
    for name in found.added:
        if rivals.get(name):
            second = rivals[name][0]
            parts.append(
                f"Why not {second.name} for {name}: with it {second.level.rms_held_out:.3g} times the noise are left."
            )
    return " ".join(parts)


def _and(words: Sequence[str]) -> str:
    return " and ".join(words) if len(words) < 3 else ", ".join(words[:-1]) + " and " + words[-1]
