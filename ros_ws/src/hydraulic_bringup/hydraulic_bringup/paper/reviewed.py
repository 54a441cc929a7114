"""What the works that the paper reviews identified, on this plant: their excitation and order, ours beside theirs.

The table "Available literature" says excitation, kind and order of each model and its best fit. What it does not say is
chosen here alike for all: 50 ms, the first half to estimate, the second to validate, one sample of dead time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hydraulic_bringup.paper import printed
from hydraulic_bringup.paper.study import BANDS, DURATION_S, KINDS, played
from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.amplitude import largest
from hydraulic_sysid.excitation.design import Wish, propose
from hydraulic_sysid.linear.identification import IdentificationSettings, identify
from hydraulic_sysid.linear.models import ArxOrder, IdentificationError, Structure, TransferFunctionOrder
from hydraulic_sysid.linear.models.structures import Arx, TransferFunction
from hydraulic_sysid.linear.validation.rmse_grid import errors

_PERIOD_S, _HOLDOUT = 0.05, 0.5
_STRUCTURES = {
    "arx": lambda order: Arx(ArxOrder(order, order, 1)),
    "transfer_function": lambda order: TransferFunction(TransferFunctionOrder(order, 0)),
}


def plans(model: Model, bandwidth: float) -> list[Plan]:
    """Plans of their excitations that the study does not play itself, as large as the limits allow on ``model``.

    :raises ExcitationError: a band that does not fit the duration.
    """
    low, high = (part * bandwidth for part in BANDS["in"])
    missing = dict.fromkeys(kind for _, kind, *_ in printed.REVIEWED if kind not in KINDS)
    return [largest(propose(kind, Wish(low, high, DURATION_S)), model).plan for kind in missing]


def table(made: Mapping[str, Plan], records: Mapping[str, Record]) -> list[dict[str, Any]]:
    """A row for each: best fit on its own second half, in free run and one step ahead, and on all of the chirp [%].

    :param made: plans by excitation
    :param records: what was recorded of them
    """
    parts = {kind: played(plan, records[kind]) for kind, plan in made.items()}
    return [_row(parts, *work) for work in printed.REVIEWED if work[1] in parts]


def _row(
    parts: Mapping[str, Record], authors: str, excitation: str, kind: str, order: int, best_fit: float | None
) -> dict[str, Any]:
    structure: Structure = _STRUCTURES[kind](order)
    found: dict[str, Any] = {"best_fit": None, "best_fit_one_step": None, "best_fit_chirp": None, "why": ""}
    try:
        document, model = identify([parts[excitation]], None, IdentificationSettings(structure, _PERIOD_S, _HOLDOUT))
        chirp = parts["chirp"]
        found["best_fit"] = document["test"]["best_fit_free_run"]
        found["best_fit_one_step"] = document["test"]["best_fit_one_step"]
        found["best_fit_chirp"] = errors(model, chirp["drive"], chirp["position"], chirp.dt)["best_fit"]
    except IdentificationError as error:
        found["why"] = str(error)
    row = {"authors": authors, "excitation": excitation, "model": structure.text, "printed_best_fit": best_fit}
    return row | found
