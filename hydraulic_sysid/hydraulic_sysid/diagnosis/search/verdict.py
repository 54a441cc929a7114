"""From a search's figures to one of four verdicts, and its sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.effect import Effect
from hydraulic_sim.model import Model
from hydraulic_sysid.data.display import TITLES, UNITS, listed, percent, quantity, resolving
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.records.paired import partner_of
from hydraulic_sysid.estimation.noise_model import SPIKY
from hydraulic_sysid.estimation.parameters import Parameters

from .candidates import candidates, subsystem
from .competing_models import CompetingModel, competing_models
from .criteria import CRITERIA
from .data_sheet import Deviation
from .drift import LEAST, Drift
from .drive_faults import DriveHypothesis
from .misfit import unexplained_share
from .nonparametric_curves import NonparametricCurve
from .remainder import Remainder, Spikes, immaterial
from .search_state import SearchResult, Together
from .set_aside import DIFFERENT, FAR_OFF, SATURATED, SetAside
from .unknown_law import probability_of_unknown
from .whereabouts import NOT_KNOWN, Whereabouts, nowhere
from .whiteness import Whiteness

MISSING = "missing"
INDISTINGUISHABLE = "indistinguishable"
COMPLETE = "complete"
DATA_SHEET = "data sheet"
RECORDING = "recording"
OUTSIDE = "outside the library"
UNDECIDED = "undecided"
DECIDED = (MISSING, COMPLETE, DATA_SHEET, RECORDING)
"""Verdicts that say which model explains the records."""

NO_EFFECT = "No effect of the library is missing."
UNCERTAIN = "No effect of the library is missing, as far as can be said before that is mended."
IN_LINE = ("valve", "sensor")  # subsystems that a signal passes on its way from the command to what is read


@dataclass(frozen=True)
class Verdict:
    """What a search says: its ``kind``, and the effects ``added``.

    Per effect added the ``competing`` models, and the ``family`` of effects that these channels cannot distinguish from
    it, however well one of them fits. ``periodic``: whether what is left goes on whatever the drive does.
    """

    kind: str
    added: Sequence[str]
    competing: Mapping[str, Sequence[CompetingModel]]
    family: Mapping[str, Sequence[str]]
    periodic: bool = False

    def indistinguishable_from(self, name: str) -> list[str]:
        """By the errors, or by the channels."""
        tied = [c.name for c in self.competing.get(name, ()) if not c.distinguishable]
        return list(dict.fromkeys([*tied, *self.family.get(name, ())]))

    @property
    def possible(self) -> list[str]:
        """What was added and, where the data do not decide, what may be in its place."""
        tied = self.added if self.kind == INDISTINGUISHABLE else ()
        return list(dict.fromkeys([*self.added, *(o for name in tied for o in self.indistinguishable_from(name))]))


def conclusive(result: SearchResult) -> SearchResult:
    """The search without its effects where the drive is not known well enough to blame physics.

    That is where they leave much, or where there was little left for them to explain.
    """
    little = result.base.misfit.variance < CRITERIA.vague_drive
    vague = drive_blamed(result) and (little or kind_of(result, tied=False) == OUTSIDE)
    if result.added and vague:
        return replace(
            result, final=result.base, misfits={}, competing={}, faults_instead=(), together_instead=Together(),
            drift=None,
        )  # fmt: skip
    return result


def judge(result: SearchResult) -> Verdict:
    """The verdict on a search."""
    final = result.final.misfit
    competing = {name: competing_models(name, state, final) for name, state in result.competing.items()}
    family = families(result.model, result.added, result.split.channels)
    return reviewed(Verdict(COMPLETE, result.added, competing, family), result)


def reviewed(verdict: Verdict, result: SearchResult, where: Whereabouts = NOT_KNOWN) -> Verdict:
    """The verdict with its kind; ``where``: what anything may explain of what is left, as far as that is known."""
    tied = any(verdict.indistinguishable_from(name) for name in verdict.added)
    tied = tied or bool(result.faults_instead or result.together_instead.faults)
    return replace(verdict, kind=kind_of(result, tied, where), periodic=goes_on(result, where))


def alternatives(result: SearchResult, verdict: Verdict) -> dict[str, Model]:
    """Fitted models with another effect in the place of one added, where the data do not decide."""
    return {
        r.name: r.refit.model
        for name, state in result.competing.items()
        for r in state.others(name)
        if verdict.kind == INDISTINGUISHABLE and r.name in verdict.indistinguishable_from(name)
    }


def families(model: Model, added: Sequence[str], channels: Sequence[str]) -> dict[str, list[str]]:
    """Effects added → those that these channels cannot distinguish from them.

    Without pressures a family of effects acts alike on the position, up to parameters that no record shows. Where the
    drive is the force itself, only those do that lie in line with the motion: before it, or behind it.
    """
    if any(c.startswith("pressure_") for c in channels):
        return {}

    def alike(effect: Effect) -> str:
        return effect.alike_without_pressures if model.kind == "hydraulic" or subsystem(effect) in IN_LINE else ""

    off, found = candidates(model), {}
    for name in added:
        family = alike(model.library[name])
        same = [e.name for e in off if family and alike(e) == family and e.name not in added]
        if same:
            found[name] = same
    return found


def kind_of(result: SearchResult, tied: bool, where: Whereabouts = NOT_KNOWN) -> str:
    """The verdict's kind; ``tied``: whether anything may be in the place of what was added.

    Where effects explain the most and no curve a part of the rest, that is how far their laws are off those of the
    bench (the touch of a backlash, the start of a cushion): nothing else is missing. Where far more than noise is left,
    and a curve explains the most of it, something else is; so it is where a law that the library lacks is more probable
    by what is left, unless it is known that no curve explains a part of that, and where the most of it is periodic of
    itself.
    """
    if result.stopped:
        return UNDECIDED
    if decisive_drift(result) is not None or goes_on(result, where):
        return OUTSIDE
    final = result.final.misfit
    little = final.little or immaterial(final, result.remainders) or result.by_force is not None
    if not result.added:
        # Faults of the recording may have explained the most of it.
        if not little and unexplained_share(result.before_laws, final) > CRITERIA.details:
            return RECORDING if drive_blamed(result) else OUTSIDE
        return RECORDING if faulty(result) else DATA_SHEET if result.moved else COMPLETE
    if strained(result) and not tied:
        return OUTSIDE
    if little:
        return INDISTINGUISHABLE if tied else MISSING
    no_law = nowhere(where.curves)
    details = final.variance < CRITERIA.small or no_law
    if final.usual > CRITERIA.right_law and any(c.share > CRITERIA.most_of for c in where.curves):
        return OUTSIDE
    allowed = CRITERIA.small_unexplained if details else CRITERIA.details
    if unexplained_share(result.base.misfit, final) > allowed and final.variance > 1.0 + 2.0 * CRITERIA.noise_missed:
        return OUTSIDE
    if probability_of_unknown(result.before_laws, final) > 0.5 and not no_law:
        return OUTSIDE
    return INDISTINGUISHABLE if tied else MISSING


def goes_on(result: SearchResult, where: Whereabouts) -> bool:
    """Whether the most of what is left is periodic of itself; a drive that is not known may be.

    A law of what was found that is not quite the bench's leaves what follows a periodic drive.
    """
    final = result.final.misfit
    little = final.little or unexplained_share(result.before_laws, final) < CRITERIA.unknown_laws
    return where.sine is not None and not (little or drive_unknown(result))


def faulty(result: SearchResult) -> bool:
    """Whether the recording, not the physics, is at fault."""
    saturated = any(a.reason == SATURATED for a in result.split.set_aside)
    return saturated or bool(result.faults) or any(s.share > SPIKY for s in result.spikes)


def decisive_drift(result: SearchResult) -> Drift | None:
    """The change along the records, if it is what no effect explains.

    Beside effects that are missing a change that a law may be off anyway is a detail, and where much is left one that
    explains little of it is, too.
    """
    found, final = result.drift, result.final.misfit
    if found is None or drive_unknown(result) or (result.added and abs(found.share) < LEAST):
        return None
    return found if final.little or found.explained >= CRITERIA.further * final.excess else None


def drifting_effect(result: SearchResult) -> str | None:
    """The effect whose parameter changes like that; None also where it is a number of the plant itself."""
    drift = decisive_drift(result)
    return drift.key.partition(".")[0] if drift is not None and "." in drift.key else None


def drive_unknown(result: SearchResult) -> bool:
    """Whether the drive that was recorded is not the one that the valve got."""
    return any(isinstance(f.hypothesis, DriveHypothesis) for f in result.faults)


def drive_blamed(result: SearchResult) -> bool:
    """Whether that is all there is to say: it explains the most, and what is left is not far off the noise.

    Disturbances of a drive are free enough to take up a part of anything.
    """
    left = result.base.misfit
    most = unexplained_share(result.before_over_noise, left) < CRITERIA.most_of
    return drive_unknown(result) and most and left.usual < CRITERIA.far_off


def strained(result: SearchResult) -> bool:
    """Whether shape parameters of effects added ended at a bound: the law had to be bent to its limits to fit.

    A shape that vanishes is no such limit: without it the law is a simpler one. Nor is one that usually is there: air
    that is compressed in no time is adiabatic.
    """
    model = result.final.model
    keys = [
        f"{name}.{p.name}"
        for name in result.added
        for p in model.library[name].parameters
        if p.null is None and p.free and p.default not in p.bounds
    ]
    shapes = Parameters.of(model, keys)
    lowest = dict(zip(shapes.keys, shapes.low.tolist(), strict=True))
    return any(side == "highest" or lowest[key] != 0.0 for key, side in shapes.at_bound.items())


def place(result: SearchResult, verdict: Verdict, left: Whereabouts) -> str | None:
    """The subsystem of the first effect added, or that where what no effect explains comes from."""
    if verdict.kind == OUTSIDE:
        drifting = drifting_effect(result)
        if drifting is not None and elsewhere(result, left.curves) is None:
            return subsystem(result.model.library[drifting])
        return left.subsystem
    return subsystem(result.model.library[result.added[0]]) if result.added else None


def elsewhere(result: SearchResult, curves: Sequence[NonparametricCurve]) -> NonparametricCurve | None:
    """The curve that explains the most of what is left, where none does nearly as well at the effect that drifts.

    What drifts elsewhere may be followed by a parameter of the model: the zero of a sensor by that of a valve.
    """
    drifting = drifting_effect(result)
    if drifting is None or not curves or curves[0].share < CRITERIA.most_of:
        return None
    own = subsystem(result.model.library[drifting])
    best, least = curves[0], CRITERIA.nearly * curves[0].share
    return None if any(c.subsystem == own and c.share > least for c in curves) else best


def sentences(result: SearchResult, verdict: Verdict, where: Whereabouts) -> str:
    """What a user reads first."""
    base, final = result.before_over_noise.rms_validation, result.final.misfit.rms_validation
    left = " ".join([remainder_sentence(result.remainders), *noise_sentences(result)])
    aside = [*paired_sentences(result), *set_aside_sentences(result.split.set_aside)]
    how = "falls" if final < base else "goes"
    fell = f"On validation data the residual {how} from {base:.3g} to {final:.3g} × noise."
    if verdict.kind == UNDECIDED:
        reached = (
            f"{listed(result.added)} added. {fell}" if result.added else f"no effect added, {final:.3g} × noise left."
        )
        return " ".join([f"Undecided: the search was ended before it was done. Best so far: {reached}", *aside])
    if verdict.kind == COMPLETE and result.final.misfit.usual > CRITERIA.small:
        return " ".join([
            f"Complete: these sensors show more than any law is right to (on validation data {final:.3g} × noise).",
            left, *aside,
        ])  # fmt: skip
    if verdict.kind == COMPLETE:
        return (
            f"Complete: on validation data the residual is {final:.3g} × noise, and no effect of the library lowers it "
            f"by more than chance. {' '.join([left, *aside])}"
        )
    if verdict.kind == RECORDING:
        found = [*recording_sentences(result), *aside, *data_sheet_sentences(result)]
        return " ".join(["Recording:", *found, fell, left, UNCERTAIN if drive_unknown(result) else NO_EFFECT])
    if verdict.kind == DATA_SHEET:
        return " ".join(["Data sheet:", *data_sheet_sentences(result), *aside, fell, left, NO_EFFECT])
    aside = [*drift_sentences(result), *aside]
    beside = [*force_sentences(result), *data_sheet_sentences(result), *recording_sentences(result), *aside]
    if verdict.kind != OUTSIDE and unexplained_share(result.base.misfit, result.final.misfit) > CRITERIA.details:
        beside.append(remainder_sentence(result.remainders))
    if verdict.kind == MISSING:
        fall = [] if result.by_force is not None else [fell]
        return " ".join([f"Missing: {listed(result.added)}.", *fall, *_instead(verdict), *_numbers(result), *beside])
    if verdict.kind == INDISTINGUISHABLE:
        parts = []
        for name in result.added:
            same = verdict.indistinguishable_from(name)
            parts.append(f"one of {{{', '.join([name, *same])}}}" if same else name)
        why = _why_alike(result.model) if verdict.family else ""
        faults = "".join(f", or nothing is, and {said}" for said in _recording_instead(result))
        return " ".join([f"Missing: {listed(parts)}{faults}. These data cannot distinguish them. {fell}{why}", *beside])
    none = "no effect of it explains what is left"
    drift = decisive_drift(result)
    text = f"Outside the library: {none if drift is None else f'{_changes(result, drift)}, as no effect does'}. "
    if result.added:
        text += f"The nearest is {listed(result.added)}. {fell} "
    else:
        text += f"On validation data the residual is {final:.3g} × noise. "
    best = where.curves[0] if where.curves and drift is None else elsewhere(result, where.curves)
    text += where.sentence(best, "" if drift is None else " more")
    # Not what the numbers of the data sheet were bent to: they imitate what no effect explains.
    return " ".join([text.strip(), *recording_sentences(result), *aside])


def force_sentences(result: SearchResult, others: bool = True) -> list[str]:
    """Why an effect is named that hardly lowers the residual, where the force has named it; of all ``others``."""
    if result.by_force is None:
        return []
    share, left = percent(result.by_force.share), f"{result.by_force.left:.2g} N"
    explains = f"{result.by_force.name} explains {share} of the mean square"
    return [
        "These sensors show more than any law is right to, so that forces are compared: of what the motion asks for "
        f"beyond the model ({left} rms), {explains}{', and no other effect nearly as much' if others else ''}."
    ]


def _why_alike(model: Model) -> str:
    if model.kind == "hydraulic":
        return " Pressures would: without them these act alike on the position."
    return " Before the motion or behind it, they act alike on the position."


def drift_sentences(result: SearchResult) -> list[str]:
    """A change along the records that does not make the verdict."""
    if result.drift is None or drive_unknown(result) or decisive_drift(result) is not None:
        return []
    return [f"Besides, {_changes(result, result.drift)}."]


def _changes(result: SearchResult, d: Drift) -> str:
    unit, sign = result.model.parameter(d.key).unit, "+" if d.change > 0.0 else ""
    by = f"{sign}{quantity(d.change, unit, error=d.standard_error)}"
    mean = quantity(d.value, unit, 3)
    return f"{d.key} changes along the records, by {by} from beginning to end ({mean} in the mean)"


def remainder_sentence(found: Sequence[Remainder]) -> str:
    """What the remainder means to somebody who uses the model."""
    seen = [r for r in found if r.beyond > CRITERIA.remainder_seen * r.noise]
    if not seen:
        return "Nothing remains beyond the noise."
    sizes = listed([f"{quantity(r.beyond, UNITS[r.channel], 2)} of {TITLES[r.channel]}" for r in seen])
    most = percent(max(CRITERIA.immaterial, *(r.share for r in seen)))
    return f"What remains beyond the noise is {sizes}, at most {most} of the motion in a segment."


def noise_sentences(result: SearchResult) -> list[str]:
    """Where the residual is not the noise that it is taken for."""
    found = result.whiteness
    return [s for w in found for s in (_coloured(w), _below(w)) if s]


def _coloured(found: Whiteness) -> str:
    if not found.coloured:
        return ""
    size = f"{found.correlation:.2g} over {quantity(found.lag, 's', 2)}"
    return f"What is left of {TITLES[found.channel]} is coloured ({size}): errors of the model or noise on the drive."


def _below(found: Whiteness) -> str:
    if found.rms > CRITERIA.below_noise:
        return ""
    return f"{TITLES[found.channel]} leaves {found.rms:.2g} × its noise: the noise was taken for larger than it is."


def data_sheet_sentences(result: SearchResult) -> list[str]:
    """What to correct in the model file, and what could be meant instead."""
    found = []
    for d in result.moved:
        said = ", or ".join(_deviation(result, one) for one in (d, *d.alternatives))
        tied = ": these data cannot distinguish them"
        if d.instead:
            said += f". {listed(d.instead)} would explain the same{tied}"
        elif d.alternatives:
            said += tied
        found.append(f"{said}.")
    return found


def _deviation(result: SearchResult, d: Deviation) -> str:
    unit, entry = result.model.parameter(d.key).unit, result.model.entry(d.key)
    nominal = quantity(d.nominal, unit, resolving(d.value, d.standard_error))
    at_bound = entry.free and entry.bounds is not None
    said = f"beyond its bound of {nominal}" if at_bound else f"not the {nominal} of the model file"
    return f"{d.key} is {quantity(d.value, unit, error=d.standard_error)}, {said}"


def recording_sentences(result: SearchResult) -> list[str]:
    """What is wrong in the records, and what to mend in the logger."""
    found = [f"{fault.text}: {fault.hypothesis.remedy}." for fault in result.faults]
    return [*found, *map(_spikes, result.spikes)]


def _spikes(s: Spikes) -> str:
    """Few of them are an accident, many a fault of the recording."""
    (name, time), one = s.places[0], s.count == 1
    what = f"{s.count} sample{'' if one else 's'} of {TITLES[s.channel]} ({100.0 * s.share:.2g} %)"
    where = f"{'' if one else 'the first '}at {time:.4g} s of {name}"
    out = "it is left out" if one else "they are left out"
    if s.share > SPIKY:
        what += " is a spike" if one else " are spikes"
        return f"{what}, {where}; {out}: look for a loose contact or a bad converter."
    return f"{what} stand{'s' if one else ''} alone far off the noise, {where}; {out}."


def paired_sentences(result: SearchResult) -> list[str]:
    """Which records are two runs of one command that were read as one."""
    pairs = [(s.record.name, partner_of(s.record)) for s in result.split.segments if partner_of(s.record) is not None]
    joined = [f"{one} and {other}" for one, other in pairs]
    return [f"Runs of one command are read as one, with both pressures: {'; '.join(joined)}."] if joined else []


def set_aside_sentences(found: Sequence[SetAside]) -> list[str]:
    """What of the records is not judged, why, and what to mend; one sentence per channel, reason and end."""
    groups: dict[tuple[str, str, bool], list[SetAside]] = {}
    for one in found:
        at_upper_end = one.reason not in (FAR_OFF, DIFFERENT) and one.reading > 0.0
        groups.setdefault((one.channel, one.reason, at_upper_end), []).append(one)
    said = []
    for (channel, reason, _), every in groups.items():
        at = quantity(float(np.median([a.reading for a in every])), UNITS[channel], 4)
        time = quantity(sum(a.seconds for a in every), "s", 3)
        if reason == SATURATED:
            said.append(
                f"{_first_upper(TITLES[channel])} is clipped at {at}: its converter is at its end for {time} of "
                f"{_count(every)}. These parts are set aside: enlarge the range."
            )
        elif reason == DIFFERENT:
            said.append(f"For {time} of {_count(every)} the two runs move differently: these parts are set aside.")
        elif reason == FAR_OFF:
            said.append(
                f"{time} of {_count(every)} are far off all else, from {every[0].time:.4g} s of {every[0].record} on, "
                "and set aside: look at what happened there."
            )
        else:
            said.append(
                f"The piston rests against a stop at {at} for {time} of {_count(every)}, and the model has none there. "
                "These parts are set aside: shift position 0 to mid stroke (column map: offset), or correct stroke."
            )
    return said


def _first_upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def _count(found: Sequence[SetAside]) -> str:
    number = len({a.record for a in found})
    return found[0].record if number == 1 else f"{number} records"


def imitated(records: Sequence[Record]) -> list[str]:
    """Effects that the amplifier or valve itself imitates, as it said when the records were made."""
    found: set[str] = set()
    for record in records:
        plant = record.description.get("plant")
        if isinstance(plant, Mapping):
            found |= {str(name) for name in plant.get("imitated_effects", ())}
    return sorted(found)


def warning(named: Sequence[str], imitations: Sequence[str]) -> str:
    """What to look at before the hydraulics are suspected; empty where nothing is imitated."""
    both = [name for name in named if name in imitations]
    if not imitations:
        return ""
    more = ": read those settings first (inspect)" if both else ""
    return f" The devices on the bus are set so that they imitate {listed(both or list(imitations))}{more}."


def _instead(verdict: Verdict) -> list[str]:
    best = {name: verdict.competing[name][0] for name in verdict.added if verdict.competing.get(name)}
    return [f"{c.name} instead of {name} leaves {c.misfit.rms_validation:.3g} × noise." for name, c in best.items()]


def _recording_instead(result: SearchResult) -> list[str]:
    """What may be wrong in the records, and in the data sheet with it, if nothing is missing."""
    found = [f.text for f in result.faults_instead]
    several = result.together_instead
    if several.faults:
        found.append(listed([*(f.text for f in several.faults), *(_deviation(result, d) for d in several.numbers)]))
    return found


def _numbers(result: SearchResult) -> list[str]:
    found = result.numbers_instead
    if not found:
        return []
    return [f"Together, {listed([d.key for d in found])} would explain as much as {result.added[-1]}: check them."]
