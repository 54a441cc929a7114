"""The study as one result document: ours beside the paper's, the thesis tried, every RMSE of the grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hydraulic_bringup.paper import printed, study
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.decimation import trace
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.linear.bandwidth import Bandwidth
from hydraulic_sysid.linear.validation import records_rmse, rmse_grid
from hydraulic_sysid.linear.validation.rmse_grid import errors

_MM2 = 1e6
_FIT_PLACES = 2  # decimals of the paper's best fits


def models_table(found: Sequence[study.Identified]) -> list[dict[str, Any]]:
    """The paper's table of best fit, MSE and FPE, ours beside it; MSE and FPE in mm²."""
    rows = []
    for one in found:
        if one.excitation.band != "in":
            continue
        kind, estimation, held = one.excitation.kind, one.document["fit"], one.document["test"]
        fit = held["best_fit_free_run"]
        rows.append(
            {
                "excitation": kind,
                "model": one.document["settings"]["structure"]["text"],
                "sampling_time": one.model.dt,
                "best_fit": fit,
                "best_fit_one_step": held["best_fit_one_step"],
                "mse_mm2": estimation["mse"] * _MM2,
                "fpe_mm2": estimation["fpe"] * _MM2,
                "printed_best_fit": printed.BEST_FIT[kind],
                "printed_mse": printed.MSE[kind],
                "printed_fpe": printed.FPE[kind],
                "reached": bool(round(fit, _FIT_PLACES) >= printed.BEST_FIT[kind]) if np.isfinite(fit) else False,
            }
        )
    return rows


def thesis_table(found: Sequence[study.Identified], cells: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Each model on the test data of the paper's band (of its own kind of excitation), and over the grid.

    ``rmse`` [m] is the root mean square over all cells; null where the model is unstable.
    """
    own = {one.excitation.kind: one.test_record for one in found if one.excitation.band == "in"}
    rows = []
    for one in found:
        name, kind = one.excitation.name, one.excitation.kind
        held = own[kind]
        common = errors(one.model, held["drive"], held["position"], held.dt)
        squares = [cell["models"][name]["rmse"] ** 2 for cell in cells]
        low, high = study.BANDS[one.excitation.band]
        rows.append(
            {
                "name": name,
                "excitation": kind,
                "band": one.excitation.band,
                "band_over_bandwidth": [low, high],
                "best_fit_own": one.document["test"]["best_fit_free_run"],
                "best_fit_in_band": common["best_fit"],
                "rmse": float(np.sqrt(np.mean(squares))),
            }
        )
    return rows


def holds(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Whether the models of the paper's band are the better ones, for each kind and for each measure.

    An unstable model, or one that could not be fitted, is worse than any other.
    """
    verdict: dict[str, Any] = {}
    for kind in study.KINDS:
        (best,) = (r for r in rows if r["excitation"] == kind and r["band"] == "in")
        others = [r for r in rows if r["excitation"] == kind and r["band"] != "in"]
        verdict[kind] = {
            "best_fit": all(not r["best_fit_in_band"] >= best["best_fit_in_band"] for r in others),
            "rmse": all(not r["rmse"] <= best["rmse"] for r in others),
        }
    return verdict


def shapes_table(cells: Sequence[Mapping[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Root mean square over amplitudes and frequencies of each shape, the least first, for both models."""
    table = {}
    for kind in study.KINDS:
        shapes = dict.fromkeys(cell["shape"] for cell in cells)
        rows = [
            {
                "shape": shape,
                "rmse": float(np.sqrt(np.mean([c["models"][kind]["rmse"] ** 2 for c in cells if c["shape"] == shape]))),
            }
            for shape in shapes
        ]
        table[kind] = sorted(rows, key=lambda row: row["rmse"])
    return table


def document(
    model_name: str,
    plant: Plant,
    bandwidth: Bandwidth,
    measured: Bandwidth | None,
    found: Sequence[study.Identified],
    records: Mapping[str, Record],
    origins: Mapping[str, str],
    recorded: Sequence[Record],
    not_fitted: Mapping[str, str],
) -> dict[str, Any]:
    """All of it.

    :param origins: record → where it is from
    :param recorded: records of the validation signals
    :param not_fitted: excitation → why it gave no model
    """
    models = {one.excitation.name: one.model for one in found}
    cells = rmse_grid(models, plant, study.grid(bandwidth.position))
    table, thesis = models_table(found), thesis_table(found, cells)
    result = holds(thesis)
    return {
        **heading("paper", 2),
        "title": f"The paper's study on {model_name}",
        "verdict": _verdict(table, result),
        "model": {"name": model_name},
        "bandwidth": _bandwidth(bandwidth),
        "bandwidth_measured": None if measured is None else _bandwidth(measured),
        "excitations": [_excitation(one, records[one.excitation.name], origins) for one in found],
        "not_fitted": dict(not_fitted),
        "models": table,
        "thesis": {"rows": thesis, "holds": result},
        "grid": cells,
        "shapes": shapes_table(cells),
        "recorded": records_rmse({k: models[k] for k in study.KINDS}, recorded) if recorded else [],
        "reviewed": [],
        "better": min((r for r in thesis if r["band"] == "in"), key=lambda r: r["rmse"])["excitation"],
        "printed": {"rmse_order": printed.RMSE_ORDER, "better": printed.BETTER},
        "left_out": list(printed.LEFT_OUT),
        "control": None,
    }


def _bandwidth(found: Bandwidth) -> dict[str, float]:
    return {name: getattr(found, name) for name in ("position", "velocity", "velocity_gain", "critical_gain")}


def _excitation(one: study.Identified, record: Record, origins: Mapping[str, str]) -> dict[str, Any]:
    plan, (held,) = one.excitation.plan, one.document["test"]["records"]
    assert plan.prediction is not None
    whole = study.played(plan, record)
    return {
        "name": one.excitation.name,
        "excitation": one.excitation.kind,
        "band": one.excitation.band,
        "origin": origins[one.excitation.name],
        "plan": {k: v for k, v in plan.as_mapping().items() if k != "prediction"},
        "prediction": plan.prediction.as_mapping(),
        "duration": whole.duration,
        "poles": one.document["model"]["poles"],
        "test_from": whole.duration - one.test_record.duration,
        "traces": {
            "drive": trace(whole.time, whole["drive"]),
            "position": trace(whole.time, whole["position"]),
            "measured": held["traces"]["measured"],
            "free_run": held["traces"]["free_run"],
            "error": held["traces"]["free_run_error"],
        },
    }


def _verdict(table: Sequence[Mapping[str, Any]], thesis: Mapping[str, Mapping[str, bool]]) -> dict[str, str]:
    fits = ", ".join(f"{r['best_fit']:.2f} % ({r['excitation']}; printed {r['printed_best_fit']:.2f} %)" for r in table)
    reached = all(r["reached"] for r in table)
    borne_out = all(all(v.values()) for v in thesis.values())
    said = (
        "Excitation outside 0.1 … 2 times the bandwidth gives worse models, by best fit and over the grid."
        if borne_out
        else "The thesis is not borne out by every measure: see below."
    )
    level = "explained" if reached and borne_out else "close" if reached or borne_out else "off"
    return {"level": level, "text": f"Best fit on test data {fits}. {said}"}
