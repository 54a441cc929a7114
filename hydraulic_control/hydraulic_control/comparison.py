"""Controllers side by side: every trial on the model and on scattered copies of it, and how much delay each bears."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from typing import Any

import numpy as np

from hydraulic_control.law import MODEL, Claim
from hydraulic_control.laws import laws
from hydraulic_control.response import Response, step_figures, tracking_figures
from hydraulic_control.scenario import scattered_models
from hydraulic_control.simulation import QUIET, SensorNoise
from hydraulic_control.trials import TRIALS, Trial, trials_of
from hydraulic_node_utils import processors
from hydraulic_sim.model import Model

COLUMNS = (
    ("rise_time", "Tr s", 1.0, 3),
    ("settling_time", "Ts s", 1.0, 3),
    ("overshoot", "OS %", 1.0, 2),
    ("rms_error", "RMS mm", 1e3, 4),
    ("largest_error", "max mm", 1e3, 3),
    ("iae", "IAE mm·s", 1e3, 3),
    ("effort", "drive V", 1.0, 3),
    ("activity", "V/s", 1.0, 1),
)
"""Key, heading, factor and decimals of what a table shows, where a trial has it; V/s: mean speed of the drive."""

MOST_DELAY_S = 0.064
_HALVINGS = 6
SAME = 0.02
"""Two laws within this part of each other are alike: tuning goes no further."""
_OVERSHOOT = 25.0  # %, from which a loop is called unsteady

Values = Mapping[str, Any]


def figures(trial: Trial, response: Response) -> dict[str, float] | None:
    """Figures of a response by name; None where the plant ran away."""
    if response.ran_away:
        return None
    return asdict(step_figures(response)) if trial.is_step else asdict(tracking_figures(response))


def compare(
    controllers: Mapping[str, Values],
    model: Model,
    plants: int,
    seed: int,
    size: float,
    noise: SensorNoise,
    say: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """All controllers on all trials: on the model, and median and worst over ``plants`` scattered copies.

    :return: a document: per trial and controller ``nominal``, ``median``, ``worst`` (figures by name or None), how many
        copies ran away, and the nominal response; per controller the ``delay_margin`` [s]
    """
    copies, tried = scattered_models(model, plants, seed), trials_of(model)
    results: dict[str, dict[str, Any]] = {}
    for controller, values in controllers.items():
        say(controller)
        with ThreadPoolExecutor(processors.usable()) as pool:
            jobs = {
                name: [
                    pool.submit(trial.response, values, one, size, noise, seed + i)
                    for i, one in enumerate((model, *copies))
                ]
                for name, trial in tried.items()
            }
            trials = {name: _summary(tried[name], [job.result() for job in found]) for name, found in jobs.items()}
        margin = delay_margin(values, model, size)
        results[controller] = {"values": dict(values), "trials": trials, "delay_margin": margin}
    return {
        "model": model.name,
        "plants": plants,
        "seed": seed,
        "size": size,
        "descriptions": {name: trial.description for name, trial in tried.items()},
        "controllers": results,
    }


def _summary(trial: Trial, responses: Sequence[Response]) -> dict[str, Any]:
    nominal, *others = (figures(trial, one) for one in responses)
    kept = [one for one in others if one is not None]
    columns = {name: np.array([one[name] for one in kept]) for name in (kept[0] if kept else ())}
    return {
        "nominal": nominal,
        "median": {name: float(np.median(c)) for name, c in columns.items()} or None,
        "worst": {name: float(np.max(c)) for name, c in columns.items()} or None,
        "ran_away": len(others) - len(kept),
        "response": responses[0].as_document(),
    }


def delay_margin(values: Values, model: Model, size: float) -> float:
    """The longest delay of the command [s] with which a step still settles, with less than 25 % of overshoot.

    By halving the interval 0 … `MOST_DELAY_S`, without noise.
    """
    step = TRIALS["step"]

    def holds(delay: float) -> bool:
        late = model.with_effect("command_delay", {"delay": delay})
        found = figures(step, step.response(values, late, size, QUIET, 0))
        return found is not None and found["overshoot"] < _OVERSHOOT and np.isfinite(found["settling_time"])

    low, high = 0.0, MOST_DELAY_S
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def claims(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What is published of the laws beside what was measured: a row for each claim of each controller.

    Of the scattered copies the median counts, where there are any; else the model. Where a law that it takes was not
    tried or ran away, ``measured`` and ``holds`` are None. ``verdict`` says it in words, and where two laws are alike.
    Of several controllers of one law the last is the one that others are compared with.
    """
    of_law = {laws()[found["values"]["controller"]].name: found["trials"] for found in document["controllers"].values()}
    usual = "median" if document["plants"] else "nominal"

    def figure(trials: Mapping[str, Any] | None, trial: str, name: str, which: str = usual) -> float | None:
        one = trials.get(trial, {}).get(which) if trials else None
        return None if one is None else float(one[name])

    rows = []
    for controller, found in document["controllers"].items():
        for claim in laws()[found["values"]["controller"]].claims:
            trials, beside = found["trials"], claim.over_trial or claim.trial
            below: float | None = 1.0
            above = figure(trials, claim.trial, claim.figure)
            if claim.over == MODEL:
                above = figure(trials, claim.trial, claim.figure, "worst" if document["plants"] else usual)
                below = figure(trials, beside, claim.figure, "nominal")
            elif claim.over or claim.over_trial:
                below = figure(of_law.get(claim.over) if claim.over else trials, beside, claim.figure)
            measured = above / below if above is not None and below else None
            holds = None if measured is None else claim.low <= measured <= claim.high
            found_so = {"measured": measured, "holds": holds, "verdict": _verdict(claim, measured, holds)}
            rows.append({"controller": controller, **asdict(claim), **found_so})
    return rows


def _verdict(claim: Claim, measured: float | None, holds: bool | None) -> str:
    if measured is None:
        return "not tried"
    if claim.over and abs(measured / claim.high - 1.0) < SAME:
        return "no difference"
    return "holds" if holds else "does not hold"


CLAIM_HEADS = ("controller", "published", "measured here", "figure", "claim", "verdict")


def claim_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """A row of `claims` for a table: controller, claim, what is measured, the figure, what the claim asks, verdict."""
    what = f"{row['figure'].replace('_', ' ')}, {row['trial']}"
    if row["over"] == MODEL:
        what += ", worst copy over the model"
    elif row["over"]:
        what += f", over that of {row['over']}"
    elif row["over_trial"]:
        what += f" over that of {row['over_trial']}"
    asked = f"≥ {row['low']:g}" if math.isinf(row["high"]) else f"≤ {row['high']:g}"
    measured = "–" if row["measured"] is None else f"{row['measured']:.2g}"
    return row["controller"], row["text"], what, measured, asked, row["verdict"]


def shown(document: Mapping[str, Any], trial: str) -> list[tuple[str, str, float, int]]:
    """The columns that a trial has."""
    found = [c["trials"][trial]["nominal"] for c in document["controllers"].values() if c["trials"][trial]["nominal"]]
    return [column for column in COLUMNS if found and column[0] in found[0]]
