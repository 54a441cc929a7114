"""Tune the controller: critical point, gains by rule, and gains optimised on the nonlinear plant.

The critical gain and period come from the linearised model, from identified models, and from a relay experiment on the
plant (or one that the node relay has made on a bench). Ziegler–Nichols, Tyreus–Luyben and pole placement turn them into
starts, from which the gains are optimised over the plant, scattered copies of it and the identified models. Writes a
parameter file for the node.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_control import gains_file, tune_run
from hydraulic_control.errors import ControlError
from hydraulic_control.identified import load_identified
from hydraulic_control.optimisers import OPTIMISERS
from hydraulic_control.parameters import CONTROLLERS, SPECS
from hydraulic_control.relay import CriticalPoint, RelaySettings
from hydraulic_control.scenario import nominal, scattered
from hydraulic_control.simulation import SensorNoise
from hydraulic_control.tuning import Criteria, Tuned, figures_of, try_step
from hydraulic_control.verbs._cells import STEP_COLUMNS, step_cells
from hydraulic_node_utils import cli, tables
from hydraulic_node_utils.json_file import read_json
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import add_trust_option

EPILOG = """\
examples:
  python -m hydraulic_control tune --out runs/npid.yaml
  python -m hydraulic_control tune --identified runs/chirp/linear_model.json --rise 0.2 --out runs/npid.yaml
  python -m hydraulic_control tune --controller pid --trials 0 --relay runs/relay.json --out runs/pid.yaml
  python -m hydraulic_control tune --controller fuzzy --optimiser particle_swarm --seed 1 --out runs/fuzzy.yaml
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("hydraulic_control tune", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("--controller", choices=CONTROLLERS, default="npid", help="law to tune (default npid)")
    parser.add_argument("--model", metavar="FILE", default="moog_mcr_m_1002_bench", help="model file or preset")
    add_trust_option(parser)
    parser.add_argument("--identified", metavar="JSON", nargs="+", default=[], help="linear_model.json of identify")
    parser.add_argument("--relay", metavar="JSON", help="result of the node relay, instead of one on the plant here")
    parser.add_argument("--relay-amplitude", metavar="V", type=cli.positive, default=0.5, help="default 0.5")
    parser.add_argument("--steps", metavar="METRES", type=cli.positive, nargs="+", default=[0.05, 0.01])
    for name, default in vars(Criteria()).items():
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, type=cli.positive, default=default, help=f"goal (default {default:g})")
    parser.add_argument("--plants", metavar="N", type=cli.count, default=5, help="scattered plants (default 5)")
    parser.add_argument("--trials", metavar="N", type=cli.count, default=300, help="0: best rule only (default 300)")
    parser.add_argument(
        "--optimiser", choices=tuple(OPTIMISERS), default="nelder_mead", help="way to search (default nelder_mead)"
    )
    parser.add_argument("--seed", metavar="N", type=cli.count, default=0, help="of its chance (default 0)")
    parser.add_argument("--no-force-feedback", action="store_true", help="without dynamic pressure feedback")
    parser.add_argument("--out", metavar="FILE", type=Path, required=True, help="parameter file to write")
    parser.add_argument("--overwrite", action="store_true", help="replace what is at --out")
    parser.add_argument("--json", action="store_true", help="print the result as JSON instead of tables")
    return cli.run(parser, _tune, argv)


def _tune(options: argparse.Namespace) -> None:
    path = cli.new_path(options.out, options.overwrite, "choose another path, or allow --overwrite")
    model = load_model(options.model)
    models = [load_identified(p) for p in options.identified]
    criteria = Criteria(**{name: getattr(options, name) for name in vars(Criteria())})
    relay = RelaySettings(amplitude=options.relay_amplitude)
    measured = _measured(Path(options.relay)) if options.relay else None
    noise = SensorNoise()
    console = Console(stderr=True)
    with console.status("critical points …"):
        found = tune_run.critical_points(model, models, noise, relay, measured)
        simple = tune_run.simple_model(model, models)
        gains = tune_run.by_rule(found, simple.velocity_gain, simple.lag)
    with console.status(f"optimising {options.controller} …"):
        tuned = tune_run.tune(
            options.controller, model, models, gains, simple, options.steps, criteria, options.plants, options.trials,
            noise, not options.no_force_feedback, _fixed(options), options.optimiser, options.seed,
        )  # fmt: skip
    path.write_text(gains_file.text(tuned.values, _remarks(options, tuned)), encoding="utf-8")
    if options.json:
        print(json.dumps(_document(found, gains, tuned), ensure_ascii=False))
        return
    out = tables.console(120)
    _show_points(out, found)
    _show_rules(out, gains)
    _show_tuned(out, options, model, tuned, noise)
    out.print(f"\n{path}")


def _fixed(options: argparse.Namespace) -> dict[str, Any]:
    """A law that is made from a model file gets the one that it is tuned on."""
    key = f"{options.controller}.model"
    return {key: options.model} if key in SPECS else {}


def _measured(path: Path) -> CriticalPoint:
    document = read_json(path, ControlError)
    try:
        return CriticalPoint(float(document["critical_gain"]), float(document["critical_period"]))
    except (ValueError, KeyError, TypeError):
        raise ControlError(f"{path}: needs numbers for critical_gain and critical_period") from None


def _remarks(options: argparse.Namespace, tuned: Tuned) -> str:
    goals = ", ".join(f"{name} {getattr(options, name):g}" for name in vars(Criteria()))
    where = f"{options.model}, {options.plants} scattered copies"
    where += f", {len(options.identified)} identified models" if options.identified else ""
    steps = ", ".join(f"{1e3 * s:g}" for s in options.steps)
    return (
        f"Gains of {options.controller}, found by tune on {where};\nsteps of {steps} mm; goals: {goals} (SI, overshoot "
        f"in %).\nCost {tuned.cost:.4g}, from {tuned.start_cost:.4g} by rule, after {tuned.trials} trials of "
        f"{options.optimiser}, seed {options.seed}."
    )


def _show_points(out: Console, found: list[tune_run.CriticalResult]) -> None:
    rows = []
    for one in found:
        cells = ("–", "–") if one.point is None else (f"{one.point.gain:.4g}", f"{1e3 * one.point.period:.4g}")
        rows.append((one.source, *cells, one.remark))
    columns = ("from", ">gain V/m", ">period ms", "")
    out.print(tables.table("critical point of a proportional loop", columns, rows))


def _show_rules(out: Console, gains: dict[str, Any]) -> None:
    rows = [(name, f"{g.kp:.4g}", f"{g.ki:.4g}", f"{g.kd:.4g}") for name, g in gains.items()]
    out.print(tables.table("gains by rule", ("rule", ">Kp V/m", ">Ki V/(m·s)", ">Kd V·s/m"), rows))


def _show_tuned(out: Console, options: argparse.Namespace, model: Any, tuned: Tuned, noise: SensorNoise) -> None:
    values = ", ".join(f"{n} {v:.4g}" for n, v in tuned.values.items() if isinstance(v, float))
    out.print(f"{options.controller}: {values}")
    out.print(f"cost {tuned.cost:.4g} (best rule {tuned.start_cost:.4g}) after {tuned.trials} trials")
    table = tables.table("steps with these values", ("plant", ">step mm", *STEP_COLUMNS))
    for case in [nominal(model, noise), *scattered(model, options.plants, tune_run.SEED, noise)]:
        for step in options.steps:
            figures = figures_of(try_step(tuned.values, case, step, 2.0))
            table.add_row(case.name, f"{1e3 * step:g}", *step_cells(None if figures is None else asdict(figures)))
    out.print(table)


def _document(found: list[tune_run.CriticalResult], gains: dict[str, Any], tuned: Tuned) -> dict[str, Any]:
    return {
        "critical_points": [
            {"source": one.source, "remark": one.remark, **(one.point.as_document() if one.point else {})}
            for one in found
        ],
        "rules": {name: asdict(g) for name, g in gains.items()},
        "values": tuned.values,
        "cost": tuned.cost,
        "start_cost": tuned.start_cost,
        "trials": tuned.trials,
    }


if __name__ == "__main__":
    sys.exit(main())
