"""The trials of `evaluate`: a table for each, and the page."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_control import gains_file
from hydraulic_control.comparison import compare, shown
from hydraulic_control.simulation import SensorNoise
from hydraulic_control.verbs._cells import finite
from hydraulic_node_utils import cli, tables
from hydraulic_node_utils.whole_file import write_text
from hydraulic_sim.model import Model


def show_trials(options: argparse.Namespace, model: Model, noise: SensorNoise, seed: int) -> None:
    """Try the gains of the options on everything; print, and write the page that is asked for."""
    path = (
        cli.new_path(options.page, options.overwrite, "choose another, or allow --overwrite") if options.page else None
    )
    console = Console(stderr=True)
    with console.status("trials …") as status:
        say = lambda name: status.update(f"trials: {name} …")  # noqa: E731
        chosen = {Path(name).stem: gains_file.load(name) for name in options.gains}
        document = compare(chosen, model, options.trials, seed, options.step, noise, say)
    if path:
        from hydraulic_control.comparison_page import page  # which brings plotly

        write_text(path, page(document))
    if options.json:
        print(json.dumps(finite(document), ensure_ascii=False))
        return
    out = tables.console(140)
    for trial, description in document["descriptions"].items():
        out.print(_trial_table(document, trial, description, options.sort))
    if path:
        out.print(f"\n{path}")


def _trial_table(document: dict[str, Any], trial: str, description: str, order: str) -> Any:
    """One trial: the model as it is and, after the stroke, the worst of the scattered plants."""
    columns = shown(document, trial)
    heads = [f">|{heading}" for _, heading, _, _ in columns]
    rows = []
    for name, found in document["controllers"].items():
        one = found["trials"][trial]
        cells = [" / ".join(_figure(one[w], key, f, d) for w in ("nominal", "worst")) for key, _, f, d in columns]
        worst = (one["worst"] or {}).get(order, math.inf) if not one["ran_away"] else math.inf
        rows.append((worst, (name, *cells, f"{one['ran_away']}", f"{1e3 * found['delay_margin']:.0f}")))
    title = f"{trial}: {description}; model / worst of {document['plants']}; late: delay that it bears"
    ordered = [cells for _, cells in sorted(rows, key=lambda row: row[0])]
    return tables.table(title, ("|controller", *heads, ">|lost", ">|late ms"), ordered)


def _figure(figures: dict[str, float] | None, key: str, factor: float, decimals: int) -> str:
    return "–" if figures is None or not math.isfinite(figures[key]) else f"{factor * figures[key]:.{decimals}f}"
