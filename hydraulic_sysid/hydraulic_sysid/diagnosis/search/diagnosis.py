"""The whole of it: search, verdict, curves of what is left, balances, and one document."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

from hydraulic_node_utils.interrupts import finishing
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.check import contradictions
from hydraulic_sysid.diagnosis.check import rows as check_rows
from hydraulic_sysid.diagnosis.locate import LocateError, balance_figures
from hydraulic_sysid.estimation.fit import FitSettings

from . import verdict as verdicts
from .criteria import CRITERIA
from .data_sheet import as_filed
from .document import document, with_balances
from .linearisation import Linearisation
from .misfit import explained
from .nonparametric_curves import nonparametric_curves
from .periodic_inputs import periodic_inputs
from .progress import Watch
from .search import Search
from .search_state import SearchResult
from .uncertainty import Known
from .unknown_inputs import unknown_inputs
from .whereabouts import NOT_KNOWN, Whereabouts

BALANCED = 40.0  # s of all records together of which balances are formed, …
SHORT = 4.0  # … and at least of each
BALANCED_SAMPLES = 100_000  # of all records together: this bounds the memory
SAMPLED = 60  # segments that are kept of what is left
HASTE = "A quick look: what is small may be missed."


@dataclass(frozen=True)
class Remaining:
    """What no effect of the library explains: a sample of the fitted model's segments, and where it comes from.

    ``beside``: effects that were added to this model.
    """

    at: Linearisation
    where: Whereabouts
    beside: Sequence[str] = ()

    @classmethod
    def of(cls, at: Linearisation, where: Whereabouts | None = None, beside: Sequence[str] = ()) -> Remaining:
        """What is left at a fitted model."""
        if where is None:
            curves, inputs = nonparametric_curves(at, _silent), unknown_inputs(at, _silent)
            where = Whereabouts.of(curves, inputs, periodic_inputs(at, _silent))
        return cls(at.sample(SAMPLED)[0], where, beside)


@dataclass(frozen=True)
class Diagnosis:
    """What came out. ``model``: where the search ended, fitted, its errors known and its history continued.

    ``competing``: models between which the data do not decide, by the effects that only they have, none where they do;
    ``result``: the document (docs/report-json.md); ``remaining``: of the verdict "outside the library".
    """

    model: Model
    competing: dict[str, Model]
    result: dict[str, Any]
    remaining: Remaining | None = None

    @property
    def decided(self) -> bool:
        """Whether the verdict says of one model that it explains the records: then that is ``model``."""
        return self.result["verdict"]["kind"] in verdicts.DECIDED


def diagnose(
    model: Model,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    settings: FitSettings | None = None,
    progress: Callable[[str], None] | None = None,
    within: float | None = None,
    watch: Watch | None = None,
    quick: bool = False,
    test: Sequence[Record] = (),
) -> Diagnosis:
    """Find the library effects that ``model`` lacks to explain ``records``.

    Parameters are fitted to ``records``; an effect counts only if it lowers the error on ``validation`` too (default:
    every third block of every record). Records need drive and position; pressures distinguish more. After ``within``
    seconds, or when the user ends it (KeyboardInterrupt), the best so far is the answer, marked as such. ``watch``
    takes what is found meanwhile: the residual whenever it is lower, and the table of candidates. A ``quick`` search
    uses fewer measured values, spread over all records, and leaves out what only confirms: whether noise hides small
    effects, whether two effects hide each other, and the balances of the whole records.

    :raises DiagnosisError: no records, or unusable ones.
    :raises hydraulic_sim.errors.ModelError: a model that does not compose.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    say = progress or (lambda _: None)
    search = Search.of(model, records, validation, settings or FitSettings(), say, within, watch, quick, test)
    say("the records against the model file")
    checked = contradictions(model, [*records, *validation])
    found = verdicts.conclusive(search.run())
    with finishing():
        verdict = verdicts.judge(found)
        outside = verdict.kind == verdicts.OUTSIDE
        # Where most is left, what was added is a proxy for something else, and bends curves and balances.
        proxy = explained(found.base.misfit, found.final.misfit) < CRITERIA.hopeless
        suspect = found.base if proxy else found.final
        much, asked = found.final.misfit.usual > CRITERIA.right_law, not (found.by_force or found.stopped)
        where = NOT_KNOWN
        if outside or (asked and not found.final.misfit.little):
            # What is periodic of itself shows beside what follows the motion, proxy or not.
            where = Whereabouts(sines=periodic_inputs(found.final.linearisation, say))
        if outside or (asked and found.added and much):
            where = Whereabouts.of(search.curves(suspect, say), (), where.sines)
        verdict = verdicts.reviewed(verdict, found, where)
        outside = verdict.kind == verdicts.OUTSIDE
        where = (
            Whereabouts.of(search.curves(suspect, say), unknown_inputs(suspect.linearisation, say), where.sines)
            if outside
            else NOT_KNOWN
        )
        beside = () if suspect is found.base else tuple(found.added)
        remaining = Remaining.of(suspect.linearisation, where, beside) if outside else None
        if not outside:  # else nothing says of any model that it is right
            found = search.with_final_values(found)
        known = search.known_of(found, () if outside else found.named)
        whole = {**document(found, verdict, known, where, search.tested(found)), "check": check_rows(checked)}
        whole["settings"] = {**whole["settings"], "quick": quick}
        if quick:
            whole["verdict"]["text"] += f" {HASTE}"
        done = as_filed(finished(found, known), model)
        competing = {
            name: as_filed(search.with_exact_laws(other, found.split, competing=True), model)
            for name, other in verdicts.alternatives(found, verdict).items()
        }
        tied = [name for name in verdict.added if verdict.indistinguishable_from(name)]
        if verdict.kind == verdicts.INDISTINGUISHABLE and tied:
            competing["+".join(tied)] = done
        before, after = found.base.model, found.final.model if found.added or found.moved else None
        del found, suspect  # their sensitivities would take up the memory that the balances need
        if quick:
            return Diagnosis(done, competing, whole, remaining)
        say("balances")
        rows, rows_after = _balances(before, records), _balances(after, records) if after else []
        return Diagnosis(done, competing, with_balances(whole, rows, rows_after), remaining)


def _silent(_: str) -> None:
    """No progress."""


def finished(found: SearchResult, known: Mapping[str, Known]) -> Model:
    """The fitted model with standard errors, and one line of history for each effect that was added."""
    done, before = found.final.model, found.base.misfit
    for key, k in known.items():
        done = done.with_entry(key, standard_error=k.standard_error if math.isfinite(k.standard_error) else None)
    validation = [r.name for r in found.split.records(validation=True)]
    for name, after in found.misfits.items():
        done = done.with_history(
            date=date.today().isoformat(),
            change=f"added {name}",
            records=[r.name for r in found.split.records()],
            validation_records=validation or "every third block of each record",
            error_before=float(f"{before.rms_validation:.4g}"),
            error_after=float(f"{after.rms_validation:.4g}"),
            error_unit="residual over noise, validation data",
        )
        before = after
    return done


def _balances(model: Model, records: Sequence[Record]) -> Sequence[Mapping[str, Any]]:
    """The balances' figures."""
    try:
        return balance_figures(model, shortened(records))
    except (LocateError, SimulationError):
        return []


def shortened(records: Sequence[Record]) -> list[Record]:
    """The middle of every record: `BALANCED` seconds and `BALANCED_SAMPLES` of all together."""
    share = min(BALANCED / sum(r.duration for r in records), BALANCED_SAMPLES / sum(map(len, records)))
    found = []
    for r in records:
        least = min(SHORT, BALANCED_SAMPLES * r.dt / len(records))
        half = 0.5 * min(max(share * r.duration, least), r.duration)
        found.append(r.window(0.5 * r.duration - half, 0.5 * r.duration + half) if share < 1.0 else r)
    return found
