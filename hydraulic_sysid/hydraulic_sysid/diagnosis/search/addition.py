"""One effect added to a model on request: fitted, tried on held-out data, and kept with its history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.estimate import CalibrationError, Settings
from hydraulic_sysid.estimation.segments import SegmentError

from .anchor import bounded
from .diagnosis import DiagnosisError, finished
from .document import added_document
from .hints import hints
from .levels import material
from .pieces import split
from .screen import screen
from .search import Found, Search
from .uncertainty import parameter_errors


@dataclass(frozen=True)
class Addition:
    """The model with the effect on, and the document. ``confirmed``: held-out data bear the effect out."""

    model: Model
    confirmed: bool
    result: dict[str, Any]


def add(
    model: Model,
    effect: str,
    records: Sequence[Record],
    held_out: Sequence[Record] = (),
    settings: Settings | None = None,
    progress: Callable[[str], None] | None = None,
) -> Addition:
    """Switch ``effect`` on, fit it with all that is free, and say what it does to the error on held-out data.

    :raises DiagnosisError: no records or unusable ones, or the effect is on already.
    :raises hydraulic_sim.errors.ModelError: an unknown effect, or one that excludes another that is on.
    """
    say = progress or (lambda _: None)
    settings = settings or Settings()
    if not records:
        raise DiagnosisError("there is no record to fit the effect to")
    if effect in model.effects:
        raise DiagnosisError(f"{effect} is on already; calibrate fits its parameters")
    model.with_effect(effect).check_complete()
    model = bounded(model)
    try:
        parts = split(records, held_out, Plant(model), settings.length)
        search = Search(parts, settings, say, hints)
        say("fitting the model as it is")
        base = search.stage(model)
        say(f"looking where {effect} begins")
        prospects = screen(base.anchor, [model.library[effect]], hints(base.anchor))
        if not prospects:
            raise DiagnosisError(f"{effect} changes nothing in these records: they do not excite it")
        trial = search.trial(base, prospects[0])
        say(f"fitting with {effect}")
        final = search.stage(trial.refit.model)
    except (SegmentError, CalibrationError) as error:
        raise DiagnosisError(str(error)) from None
    base = replace(base, trials=[trial], prospects=prospects)
    found = Found(base, final, [effect], [(effect, final.level)], {effect: base})
    confirmed = material(base.level, final.level)
    known = parameter_errors(final.anchor)
    result = added_document(model, records, held_out, parts, settings, found, known, confirmed)
    return Addition(finished(found, known, records, held_out), confirmed, result)
