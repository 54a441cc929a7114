"""The whole of it: search, verdict, shape of what is left, balances, and one document."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.locate import LocateError, balance_figures, locate
from hydraulic_sysid.estimation.estimate import CalibrationError, Settings
from hydraulic_sysid.estimation.segments import SegmentError

from . import verdict
from .anchor import bounded
from .document import add_balances, document
from .hints import hints
from .levels import Level, repaired
from .pieces import split
from .rivals import rivals
from .search import HOPELESS, Found, Search
from .shape import Shape, shapes
from .uncertainty import Known, parameter_errors


class DiagnosisError(HydraulicError, ValueError):
    """Records or model do not allow a diagnosis; the message says what is needed."""


@dataclass(frozen=True)
class Diagnosis:
    """What came out. ``model``: with the missing effects on, fitted, its errors known and its history continued.

    ``rivals``: models with another effect in the place of one found, where the data do not decide; ``result``: the
    document (docs/report-json.md).
    """

    model: Model
    rivals: dict[str, Model]
    result: dict[str, Any]


def diagnose(
    model: Model,
    records: Sequence[Record],
    held_out: Sequence[Record] = (),
    settings: Settings | None = None,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find the library effects that ``model`` lacks to explain ``records``.

    Parameters are fitted to ``records``; an effect counts only if it lowers the error on ``held_out`` too (default:
    every third stretch of every record is held out). Records need drive and position; pressures tell more apart.

    :raises DiagnosisError: no records, or unusable ones.
    :raises hydraulic_sim.errors.ModelError: a model that does not compose.
    :raises hydraulic_sim.errors.SimulationError: when the model cannot be run along a record.
    """
    say = progress or (lambda _: None)
    settings = settings or Settings()
    if not records:
        raise DiagnosisError("there is no record to diagnose")
    model = bounded(model)
    try:
        parts = split(records, held_out, Plant(model), settings.length)
        found = Search(parts, settings, say, hints).run(model)
    except (SegmentError, CalibrationError) as error:
        raise DiagnosisError(str(error)) from None
    others = {name: rivals(name, stage, found.final.level) for name, stage in found.rivals.items()}
    channels = {c for p in parts.pieces for c in p.channels}
    family = verdict.alike(model, found.added, sorted(channels))
    kind = verdict.kind_of(found, others, family)
    curves: list[Shape] = []
    # Where most is left, what was added stands in for something else, and bends curves and balances.
    stand_in = repaired(found.base.level, found.final.level) < HOPELESS
    if kind == verdict.OUTSIDE:
        curves = shapes((found.base if stand_in else found.final).anchor, say)
    known = parameter_errors(found.final.anchor)
    diagnosed = finished(found, known, records, held_out)
    result = document(model, records, held_out, parts, settings, found, others, family, known, kind, curves)
    tied = {}
    for name in found.added if kind == verdict.TIED else ():
        same = verdict.same_as(name, others, family)
        tied.update({t.name: t.refit.model for t in found.rivals[name].trials if t.name in same})
    say("balances")
    base, final, added = found.base.model, found.final.model, bool(found.added)
    del found  # its sensitivities would take up the memory that the balances need
    outside = kind == verdict.OUTSIDE
    before, blamed = _balances(base, records, blame=outside and stand_in)
    after, blamed_after = _balances(final, records, blame=outside and not stand_in) if added else ([], [])
    add_balances(result, before, after, blamed or blamed_after)
    return Diagnosis(diagnosed, tied, result)


def _balances(model: Model, records: Sequence[Record], blame: bool) -> tuple[list[dict[str, Any]], list[str]]:
    """The balances' figures; and, if somebody is to ``blame``, subsystems by what each explains of them, most first."""
    try:
        if not blame:
            return balance_figures(model, records), []
        found = locate(model, records, maps=False)
    except (LocateError, SimulationError):
        return [], []
    return found["balances"], [str(s["name"]) for s in found["attribution"]]


def finished(found: Found, known: Mapping[str, Known], records: Sequence[Record], held_out: Sequence[Record]) -> Model:
    """The fitted model with standard errors, and one line of history for each effect that was added."""
    done = found.final.model
    for key, k in known.items():
        error = k.standard_error
        done = done.with_entry(key, standard_error=error if error < float("inf") else None)
    before: Level = found.base.level
    for name, after in found.steps:
        done = done.with_history(
            date=date.today().isoformat(),
            change=f"added {name}",
            records=[r.name for r in records],
            validation_records=[r.name for r in held_out] or "every third block of each record",
            error_before=float(f"{before.rms_held_out:.4g}"),
            error_after=float(f"{after.rms_held_out:.4g}"),
            error_unit="residual over noise, validation data",
        )
        before = after
    return done
