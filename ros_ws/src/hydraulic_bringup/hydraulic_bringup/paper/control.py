"""The controller of the study: NPID on both identified models and on the nonlinear plant, beside the paper's table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hydraulic_bringup.paper import study
from hydraulic_control import evaluation, gains_file, paper
from hydraulic_control.identified import load_identified
from hydraulic_control.simulation import SensorNoise
from hydraulic_sim.model import Model
from hydraulic_sysid.linear.identification import about
from hydraulic_sysid.linear.models.model_file import write_linear_model

GAINS = "npid"
STEP_M = 0.05
_FIGURES = ("rise_time", "settling_time", "overshoot")


def save_models(found: Sequence[study.Identified], out: Path) -> dict[str, Path]:
    """Write the models of the paper's band, for the controller's tuning and whoever else; excitation → file."""
    files = {}
    for one in found:
        if one.excitation.band == "in":
            folder = out / "models"
            folder.mkdir(parents=True, exist_ok=True)
            files[one.excitation.kind] = write_linear_model(
                folder / f"{one.excitation.kind}.json", one.model, **about(one.document)
            )
    return files


def evaluate(model: Model, files: dict[str, Path]) -> dict[str, Any]:
    """Steps, staircases and sines with the shipped NPID gains: rows of figures, the paper's beside the steps.

    :raises ControlError: a model that no loop can be closed around.
    """
    models = [replace(load_identified(path), name=kind) for kind, path in files.items()]
    result = evaluation.evaluate(gains_file.load(GAINS), model, models, [], STEP_M, SensorNoise())
    rows = {(r["where"], r["reference"]): r for r in result["rows"]}
    steps = []
    for kind in files:
        printed = paper.STEPS[kind]
        for where, figures in ((f"identified {kind}", printed[0]), ("nonlinear", printed[1])):
            steps.append(_row(f"{where}, {kind}" if where == "nonlinear" else where, rows[where, "step"], figures))
    tracking = [
        {"where": r["where"], "reference": r["reference"], **{k: r.get(k) for k in ("rms_error", "largest_error")}}
        for r in result["rows"]
        if r["reference"] != "step"
    ]
    text = (
        f"Step of {1e3 * STEP_M:g} mm with the NPID gains that were tuned for {model.name} (`{GAINS}`); in brackets "
        "what the paper prints for steps it does not name. The nonlinear plant is one and the same in both rows."
    )
    return {"gains": result["values"], "step": STEP_M, "text": text, "rows": steps, "tracking": tracking}


def _row(where: str, figures: dict[str, Any], printed: paper.PaperStep) -> dict[str, Any]:
    return {
        "where": where,
        **{key: None if figures["runs_away"] else figures[key] for key in _FIGURES},
        "printed": {key: getattr(printed, key) for key in _FIGURES},
    }
