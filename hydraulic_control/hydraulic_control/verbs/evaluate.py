"""Judge gains as the paper does: step, staircase and sine on identified models, nonlinear plant and bench.

The figures stand beside the paper's. With --scatter the same step is tried on scattered copies of the plant, so that
controllers can be compared by their median and their worst case. With --trials they are tried on everything else as
well: sweep, load step, supply that falls, leakage, varying load and supply, noisy sensors; --page shows all of it.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_control import evaluation, gains_file, paper
from hydraulic_control.comparison import COLUMNS
from hydraulic_control.errors import ControlError
from hydraulic_control.identified import load_identified
from hydraulic_control.response import Response
from hydraulic_control.simulation import QUIET, SensorNoise
from hydraulic_control.trajectories import KINDS
from hydraulic_control.tuning import Criteria
from hydraulic_control.verbs._cells import STEP_COLUMNS, finite, step_cells
from hydraulic_control.verbs._trials import show_trials
from hydraulic_node_utils import cli, tables
from hydraulic_node_utils.json_file import read_json
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import add_trust_option

EPILOG = """\
examples:
  python -m hydraulic_control evaluate --gains npid pid --scatter 24
  python -m hydraulic_control evaluate --gains npid --identified runs/chirp/linear_model.json
  python -m hydraulic_control evaluate --gains pid mpc model_inversion --trials 24 --page runs/laws.html
"""
_TOLD = 0.01  # part of a response that may be missing without a word
SEED = 2026  # of the plants that gains are judged on: not those of tuning


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("hydraulic_control evaluate", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument(
        "--gains",
        metavar="FILE",
        nargs="+",
        default=["npid"],
        help=f"parameter files, or shipped ones: {', '.join(gains_file.shipped())} (default npid)",
    )
    parser.add_argument("--model", metavar="FILE", default="moog_mcr_m_1002_bench", help="model file or preset")
    add_trust_option(parser)
    parser.add_argument("--identified", metavar="JSON", nargs="+", default=[], help="linear_model.json of identify")
    parser.add_argument("--bench", metavar="JSON", nargs="+", default=[], help="responses that the node reference kept")
    parser.add_argument("--step", metavar="METRES", type=cli.positive, default=0.05, help="step (default 0.05)")
    parser.add_argument("--scatter", metavar="N", type=cli.count, default=0, help="scattered plants (default 0)")
    parser.add_argument("--trials", metavar="N", type=cli.count, help="all trials, and N scattered plants each")
    keys = [key for key, *_ in COLUMNS]
    parser.add_argument(
        "--sort", choices=keys, default="rms_error", help="order of the trials' tables, by the worst plant"
    )
    parser.add_argument("--page", metavar="FILE", type=Path, help="with --trials: page to write")
    parser.add_argument("--overwrite", action="store_true", help="replace what is at --page")
    parser.add_argument("--no-noise", action="store_true", help="sensors without noise")
    parser.add_argument("--json", action="store_true", help="print the result as JSON instead of tables")
    return cli.run(parser, _evaluate, argv)


def _evaluate(options: argparse.Namespace) -> None:
    model = load_model(options.model)
    noise = QUIET if options.no_noise else SensorNoise()
    stems = [Path(name).stem for name in options.gains]
    names = [stem if stems.count(stem) == 1 else name for name, stem in zip(options.gains, stems, strict=True)]
    controllers = {name: gains_file.load(file) for name, file in zip(names, options.gains, strict=True)}
    if options.trials is not None:
        if options.identified or options.bench or options.scatter:
            raise ControlError("--trials are on the model alone: not together with --identified, --bench or --scatter")
        show_trials(options, controllers, model, noise, SEED)
        return
    if options.page:
        raise ControlError("--page is for --trials N: it shows the trials")
    models = [load_identified(path) for path in options.identified]
    bench = [_bench(Path(path)) for path in options.bench]
    results = {}
    for name, values in controllers.items():
        result = evaluation.evaluate(values, model, models, bench, options.step, noise)
        if options.scatter:
            result["scatter"] = evaluation.over_scatter(
                values, model, options.scatter, SEED, options.step, noise, Criteria()
            )
        results[name] = result
    if options.json:
        print(json.dumps(finite(results), ensure_ascii=False))
        return
    console = tables.console(120)
    for name, result in results.items():
        _show_steps(console, name, result, options.step)
        _show_tracking(console, name, result)
    if options.scatter:
        _show_scatter(console, results, options.scatter)


def _bench(path: Path) -> tuple[str, Response]:
    document = read_json(path, ControlError)
    kind = document.get("kind") if isinstance(document, dict) else None
    if kind not in KINDS:
        raise ControlError(f"{path}: kind is {kind!r}; allowed are {', '.join(KINDS)}")
    response = Response.from_document(document)
    lost, longest = response.gaps()
    if lost > _TOLD:
        text = f"{path}: {lost:.0%} of the states were not heard, for up to {1e3 * longest:.0f} ms: its figures are"
        print(f"{text} those of a machine that did not keep up", file=sys.stderr)
    return kind, response


def _show_steps(console: Console, name: str, result: dict[str, Any], step: float) -> None:
    columns = ("|plant", *STEP_COLUMNS, ">|effort V", ">|paper Tr / Ts / OS")
    table = tables.table(f"{name}: step of {1e3 * step:g} mm", columns)
    for row in result["rows"]:
        if row["reference"] == "step":
            lost = row["runs_away"]
            cells = step_cells(None if lost else row)
            table.add_row(row["where"], *cells, "" if lost else f"{row['effort']:.2f}", _paper(row["where"], result))
    console.print(table)
    for agreement in result["agreement"]:
        printed = paper.beside(agreement["identified"])
        word = "agree" if agreement["alike"] else "do not agree"
        text = f"identified {agreement['identified']} and nonlinear plant {word} within 15 % on each figure"
        if printed:
            better = evaluation.better_than_paper(result, agreement["identified"])
            word = "better than" if better else "not better than"
            text += f"; nonlinear plant {word} the paper's {_triple(printed[1])}"
        console.print(text)


def _paper(where: str, result: dict[str, Any]) -> str:
    """The paper's figures for that line: its identified model, or its nonlinear one by what it was tuned on."""
    if where == "nonlinear":
        found = [paper.beside(a["identified"]) for a in result["agreement"]]
        return ", ".join(_triple(f[1]) for f in found if f) or "–"
    printed = paper.beside(where)
    return _triple(printed[0]) if printed else "–"


def _triple(printed: paper.PaperStep) -> str:
    return " / ".join(f"{value:g}" for value in printed)


def _show_tracking(console: Console, name: str, result: dict[str, Any]) -> None:
    columns = ("|plant", "|reference", ">|RMS error mm", ">|largest error mm", ">|effort V", ">|drive's speed V/s")
    table = tables.table(f"{name}: tracking", columns)
    for row in result["rows"]:
        cells = ["runs away", "", "", ""]
        if not row["runs_away"]:
            cells = [f"{1e3 * row['rms_error']:.3f}", f"{1e3 * row['largest_error']:.3f}"]
            cells += [f"{row['effort']:.3f}", f"{row['activity']:.1f}"]
        table.add_row(row["where"], row["reference"], *cells)
    console.print(table)


def _show_scatter(console: Console, results: dict[str, Any], count: int) -> None:
    columns = ("|gains", "|", *STEP_COLUMNS, ">|drive's speed V/s", ">|cost", ">|unsettled")
    table = tables.table(f"the same step on {count} scattered plants", columns)
    for name, result in results.items():
        found = result["scatter"]
        for which in ("median", "worst"):
            lost = f"{found['unsettled'] + found['ran_away']}" if which == "worst" else ""
            if f := found[which]:
                table.add_row(name, which, *step_cells(f), f"{f['activity']:.1f}", f"{f['cost']:.3f}", lost)
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
