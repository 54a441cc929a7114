"""``paper``: the study of Nisar & Munawar in one go, beside the figures that it prints.

The bandwidth, excitations of 50 s chosen from it and as large as the limits allow, their records through the node
graph, the paper's two models, best fit, MSE and FPE on its splits, the RMSE of both over its four test signals, and the
thesis itself: excitations below and above the band. About ten minutes; --quick plays short records of the paper's band
and rehearses the rest on the model; --rehearse needs no graph at all.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_bringup.demo import online
from hydraulic_bringup.demo.errors import DemoError
from hydraulic_bringup.paper import control, playing, reviewed, study
from hydraulic_bringup.paper.document import document
from hydraulic_bringup.paper.printing import show
from hydraulic_bringup.verbs.demo import ProgressSteps, new_folder
from hydraulic_node_utils import cli
from hydraulic_sim.model_file import load_model, presets
from hydraulic_sim.plant import Plant
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation import Plan, load_plan
from hydraulic_sysid.linear.bandwidth import Bandwidth, BandwidthError, from_model, from_record
from hydraulic_sysid.linear.models import IdentificationError
from hydraulic_sysid.report import write_page

DEFAULT = "moog_mcr_m_1002_bench"
_SHAPES_S = 20.0
_START_S = 6.0  # of recorder and excitation, per experiment


def main(argv: list[str] | None = None) -> int:
    """Run the study; 0 done, 1 a step failed, 2 bad options or input, 130 interrupted."""
    code = cli.run(_parser(), _run, argv, stopped="every process of the study has been stopped")
    online.take_down_left(code)
    return code


def _parser() -> argparse.ArgumentParser:
    parser = cli.parser("paper", __doc__)
    parser.add_argument("--model", metavar="FILE", default=DEFAULT, help=f"model file or preset (default {DEFAULT})")
    add_trust_option(parser)
    parser.add_argument("--plant", choices=tuple(online.PLANTS), default="sim", help="what is excited (default sim)")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--quick", action="store_true", help="short records of the paper's band through the graph")
    how.add_argument("--rehearse", action="store_true", help="everything on the model, without the node graph")
    parser.add_argument("--out", metavar="DIR", type=Path, help="new folder of the run (default runs/<date>-paper)")
    return parser


def _run(options: argparse.Namespace) -> None:
    online.interrupt_on_sigterm()
    console = Console(highlight=False)
    model = load_model(options.model)
    out = new_folder(options.out, "paper")
    begun = time.monotonic()
    duration = study.SHORT_S if options.quick else study.DURATION_S
    graph_s = 0.0 if options.rehearse else 2 * (duration + _START_S) if options.quick else 520.0
    console.print(f"the paper's study on {model.name}; results in {out}", soft_wrap=True)
    with ProgressSteps(console, graph_s + 60.0) as steps:
        steps.begin("bandwidth and excitations", 20.0)
        bandwidth = from_model(model)
        bands = tuple(band for band in study.BANDS if not (options.quick and band == "in"))
        made = study.excitations(model, bandwidth.position, study.DURATION_S, steps.tick, bands)
        if options.quick:
            short = study.excitations(model, bandwidth.position, duration, steps.tick, ("in",))
            made = [*(replace(e, plan=replace(e.plan, approach=study.SHORT_APPROACH_S)) for e in short), *made]
        extra = (
            [] if options.quick else [load_plan("probe"), *study.recorded_shapes(model, bandwidth.position, _SHAPES_S)]
        )
        steps.done()
        plans = [e.plan for e in made]
        live = (
            [] if options.rehearse else [e.plan for e in made if e.band == "in"] if options.quick else [*plans, *extra]
        )
        records = _play(options, model, live, out, steps)
        origins = {name: f"{options.plant} through the node graph" for name in records}
        steps.begin("rehearse on the model", 10.0)
        of_others = reviewed.plans(model, bandwidth.position)
        rest = [plan for plan in [*plans, *extra, *of_others] if plan.name not in records]
        records |= playing.on_the_model(rest, model, steps)
        origins |= {plan.name: "rehearsed on the model" for plan in rest}
        steps.done()
        result = _analyse(model, bandwidth, made, extra, records, origins, out, steps)
        by_kind = {one.kind: one.plan for one in made if one.band == "in"} | {plan.name: plan for plan in of_others}
        result["reviewed"] = reviewed.table(by_kind, records)
        results.write_result(out, result)
        page = write_page(out, results.read_folder(out))
    show(result, console)
    console.print(f"\n{time.monotonic() - begun:.0f} s. Open the report: [bold]{page}[/bold]", soft_wrap=True)


def _play(options: argparse.Namespace, model: Any, plans: list[Plan], out: Path, steps: Any) -> dict[str, Record]:
    if not plans:
        return {}
    path = model.path or presets()[model.name]
    return playing.through_the_graph(plans, path, options.plant, out, steps)


def _analyse(
    model: Any,
    bandwidth: Bandwidth,
    made: list[study.Excitation],
    extra: list[Plan],
    records: dict[str, Record],
    origins: dict[str, str],
    out: Path,
    steps: Any,
) -> dict[str, Any]:
    steps.begin("identify", 5.0)
    found, not_fitted = [], {}
    for one in made:
        try:
            found.append(study.identified(one, records[one.name]))
        except IdentificationError as error:
            if one.band == "in":
                raise DemoError("identify", str(error)) from None
            not_fitted[one.name] = str(error)
        steps.tick()
    steps.done()
    steps.begin("validate", 25.0)
    measured = None
    if "probe" in records:
        try:
            measured = from_record(records["probe"])[0]
        except BandwidthError as error:
            steps.say(f"bandwidth not measured: {error}")
    shapes = [replace(study.played(p, records[p.name]), name=p.name) for p in extra if p.name != "probe"]
    result = document(model.name, Plant(model), bandwidth, measured, found, records, origins, shapes, not_fitted)
    steps.done()
    steps.begin("control", 10.0)
    result["control"] = control.evaluate(model, control.save_models(found, out))
    steps.done()
    return result


if __name__ == "__main__":
    sys.exit(main())
