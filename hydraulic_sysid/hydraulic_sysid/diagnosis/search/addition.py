"""One effect added to a model on request: fitted, tried on validation data, and kept with its history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.fit import FitSettings

from .data_sheet import as_filed
from .diagnosis import finished
from .document import added_document
from .errors import DiagnosisError
from .misfit import material
from .progress import Watch
from .search import Search


@dataclass(frozen=True)
class Addition:
    """The model with the effect on, and the document. ``confirmed``: validation data bear the effect out."""

    model: Model
    confirmed: bool
    result: dict[str, Any]


def add(
    model: Model,
    effect: str,
    records: Sequence[Record],
    validation: Sequence[Record] = (),
    settings: FitSettings | None = None,
    progress: Callable[[str], None] | None = None,
    watch: Watch | None = None,
    test: Sequence[Record] = (),
) -> Addition:
    """Switch ``effect`` on, fit it with all that is free, and say what it does to the error on data that no fit saw.

    :raises DiagnosisError: no records or unusable ones, or the effect is on already.
    :raises hydraulic_sim.errors.ModelError: an unknown effect, or one that excludes another that is on.
    """
    if effect in model.effects:
        raise DiagnosisError(f"{effect} is on already; calibrate fits its parameters")
    model.with_effect(effect).check_complete()
    say = progress or (lambda _: None)
    search = Search.of(model, records, validation, settings or FitSettings(), say, watch=watch, test=test)
    found = search.with_final_values(search.add(effect))
    confirmed = found.by_force is not None or material(found.base.misfit, found.final.misfit)
    known = search.known_of(found, found.named)
    result = added_document(found, known, confirmed, search.tested(found))
    return Addition(as_filed(finished(found, known), model), confirmed, result)
