"""The trials of `evaluate`: a table for each, and the page."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from hydraulic_control.comparison import CLAIM_HEADS, Values, claim_cells, claims, compare, shown
from hydraulic_control.simulation import SensorNoise
from hydraulic_control.verbs._cells import finite
from hydraulic_node_utils import cli, tables
from hydraulic_node_utils.whole_file import write_text
from hydraulic_sim.model import Model


def show_trials(
    options: argparse.Namespace, controllers: Mapping[str, Values], model: Model, noise: SensorNoise, seed: int
) -> None:
    """Try controllers on everything; print, and write the page that is asked for."""
    path = options.page and cli.new_path(options.page, options.overwrite, "choose another, or allow --overwrite")
    console = Console(stderr=True)
    with console.status("trials …") as status:
        say = lambda name: status.update(f"trials: {name} …")  # noqa: E731
        document = compare(controllers, model, options.trials, seed, options.step, noise, say)
    if path:
        from hydraulic_control.comparison_page import page  # which brings plotly

        write_text(path, page(document))
    if options.json:
        print(json.dumps(finite({**document, "claims": claims(document)}), ensure_ascii=False))
        return
    out = tables.console(120)
    for trial, description in document["descriptions"].items():
        out.print(_trial_table(document, trial, description, options.sort))
    rows = [claim_cells(row) for row in claims(document)]
    if rows:
        out.print(tables.table("what is published of these laws", CLAIM_HEADS, rows))
    if path:
        out.print(f"\n{path}")


def _trial_table(document: dict[str, Any], trial: str, description: str, order: str) -> Any:
    """One trial: the model as it is, and the worst of the scattered plants."""
    columns = shown(document, trial)

    def worst(controller: str) -> float:
        one = document["controllers"][controller]["trials"][trial]
        return math.inf if one["ran_away"] else float((one["worst"] or {}).get(order, math.inf))

    heads = [f">|{heading}" for _, heading, _, _ in columns]
    title = f"{trial}: {description}; lost: plants that ran away, late: delay that is borne"
    table = tables.table(title, ("|controller", "|", *heads, ">|lost", ">|late ms"))
    for name in sorted(document["controllers"], key=worst):
        found = document["controllers"][name]
        one = found["trials"][trial]
        rows = {which: [_figure(one[which], key, f, d) for key, _, f, d in columns] for which in ("nominal", "worst")}
        table.add_row(name, "model", *rows["nominal"], "", f"{1e3 * found['delay_margin']:.0f}")
        if document["plants"]:
            table.add_row("", f"worst of {document['plants']}", *rows["worst"], f"{one['ran_away']}", "")
    return table


def _figure(figures: dict[str, float] | None, key: str, factor: float, decimals: int) -> str:
    return "–" if figures is None or not math.isfinite(figures[key]) else f"{factor * figures[key]:.{decimals}f}"
