"""Gains judged as in the paper: step, staircase and sine on identified models, the nonlinear plant and the bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hydraulic_control import paper
from hydraulic_control.controller import Controller
from hydraulic_control.identified import IdentifiedModel
from hydraulic_control.response import Response, step_figures, tracking_figures
from hydraulic_control.scenario import Case, identified, nominal, scattered
from hydraulic_control.simulation import QUIET, SensorNoise, run
from hydraulic_control.trajectories import MotionLimits, make
from hydraulic_control.tuning import Criteria, figures_of, try_step
from hydraulic_sim.model import Model

ALIKE = 0.15
"""Identified and nonlinear model agree when a figure differs by no more than this part …"""
RESOLVED = {"rise_time": 2e-3, "settling_time": 5e-3, "overshoot": 0.2}
"""… or by no more than what two runs on a bench would differ: s, s, %."""
_LIMITS = MotionLimits(travel=10.0, velocity=10.0, acceleration=1e3)


def respond(values: Mapping[str, Any], case: Case, kind: str, settings: Mapping[str, Any]) -> Response:
    """The response of a plant to a reference of that kind (`trajectories.make`)."""
    trajectory = make(kind, settings, _LIMITS)
    return run(case.plant, Controller(values), trajectory.at, trajectory.duration)


def settings_for(step: float) -> dict[str, dict[str, Any]]:
    """The references of an evaluation for a step of ``step`` [m]: the paper's kinds, as large as the step."""
    common = {"offset": 0.0, "amplitude": step, "frequency": 0.5, "cycles": 3, "levels": 4, "dwell": 2.0}
    return {"step": common, "staircase": {**common, "dwell": 1.0}, "sine": common}


def row(name: str, kind: str, response: Response) -> dict[str, Any]:
    """One line of the tables: what, where, and the figures."""
    figures = {"runs_away": response.ran_away}
    if not figures["runs_away"]:
        figures |= asdict(tracking_figures(response))
        if kind == "step":
            figures |= asdict(step_figures(response))
    return {"where": name, "reference": kind, **figures}


def evaluate(
    values: Mapping[str, Any],
    model: Model,
    models: Sequence[IdentifiedModel],
    bench: Sequence[tuple[str, Response]],
    step: float,
    noise: SensorNoise,
) -> dict[str, Any]:
    """Rows for every plant and reference; ``bench`` holds recorded responses with their kinds."""
    cases = [(f"identified {m.name}", c) for m, c in zip(models, identified(models), strict=True)]
    cases.append(("nonlinear", nominal(model, noise)))
    common = settings_for(step)
    rows = [
        row(name, kind, respond(values, case, kind, settings))
        for name, case in cases
        for kind, settings in common.items()
    ]
    rows += [row("bench", kind, response) for kind, response in bench]
    quiet = row("nonlinear, no sensor noise", "step", respond(values, nominal(model, QUIET), "step", common["step"]))
    return {"values": dict(values), "rows": rows, "agreement": [_agree(m.name, rows, quiet) for m in models]}


def over_scatter(
    values: Mapping[str, Any], model: Model, count: int, seed: int, step: float, noise: SensorNoise, criteria: Criteria
) -> dict[str, Any]:
    """Median and worst of the figures over ``count`` scattered plants; those that run away or never settle counted."""
    found = []
    for case in scattered(model, count, seed, noise):
        figures = figures_of(try_step(values, case, step, 2.0))
        if figures is not None:
            found.append({**asdict(figures), "cost": criteria.cost(figures, step)})
    names = list(found[0]) if found else []
    columns = {name: np.array([f[name] for f in found]) for name in names}
    return {
        "plants": count,
        "ran_away": count - len(found),
        "unsettled": int(np.sum(~np.isfinite(columns["settling_time"]))) if found else 0,
        "median": {name: float(np.median(c)) for name, c in columns.items()},
        "worst": {name: float(np.max(c)) for name, c in columns.items()},
    }


def better_than_paper(document: Mapping[str, Any], name: str) -> bool | None:
    """Whether the nonlinear plant betters the paper in all three figures at once; None where the paper has none."""
    printed = paper.beside(name)
    if printed is None:
        return None
    ours = next(r for r in document["rows"] if r["where"] == "nonlinear" and r["reference"] == "step")
    return not ours["runs_away"] and all(ours[key] <= limit for key, limit in printed[1]._asdict().items())


def _agree(name: str, rows: Sequence[Mapping[str, Any]], nonlinear: Mapping[str, Any]) -> dict[str, Any]:
    """The identified model's step beside the nonlinear plant's, both without noise."""
    mine = next(r for r in rows if r["where"] == f"identified {name}" and r["reference"] == "step")
    figures = {}
    for key, resolution in RESOLVED.items():
        a, b = (float(r.get(key, float("inf"))) for r in (mine, nonlinear))
        apart = abs(a - b)
        alike = bool(np.isfinite(apart) and (apart <= ALIKE * abs(b) or apart <= resolution))
        figures[key] = {"identified": a, "nonlinear": b, "alike": alike}
    return {"identified": name, "figures": figures, "alike": all(f["alike"] for f in figures.values())}
