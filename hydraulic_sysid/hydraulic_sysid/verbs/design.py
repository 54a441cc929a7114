"""Design an excitation from the actuator's bandwidth, as large as its limits allow on the model.

The amplitude is the largest at which neither drive, travel, velocity nor pressures leave their limits in a simulated on
the model. Writes the plan, with what the model does under it, for the excitation node; design.json and a page.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import Any

from rich.console import Console

from hydraulic_node_utils import cli, tables
from hydraulic_sim.model_file import Model, load_model
from hydraulic_sysid.data.display import quantity, span
from hydraulic_sysid.excitation import load_plan, save_plan
from hydraulic_sysid.excitation.amplitude import Limits, Sized, largest
from hydraulic_sysid.excitation.design import SIGNALS, Wish, propose
from hydraulic_sysid.excitation.design_document import document
from hydraulic_sysid.linear.bandwidth import from_model, from_simulation
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid design chirp --model moog_mcr_m_1002_bench --out runs/design
  python -m hydraulic_sysid design odd_random_phase_multisine --model my.yaml --realisations 4 --out runs/four
  python -m hydraulic_sysid design prbs --model my.yaml --band 0.5 20 --duration 30 --out runs/prbs

The plan is played by the excitation node: -p plan:=runs/design/chirp.yaml
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("design", __doc__, EPILOG)
    parser.add_argument("signal", metavar="SIGNAL", choices=tuple(SIGNALS), help=f"one of {', '.join(SIGNALS)}")
    opt.add_model_option(parser)
    band = parser.add_mutually_exclusive_group()
    band.add_argument("--bandwidth", metavar="HZ", type=float, help="of the actuator (default: that of the model)")
    band.add_argument("--probe", metavar="PLAN", help="bandwidth of a probe played on the model, with its friction")
    band.add_argument("--band", metavar=("LOW", "HIGH"), type=float, nargs=2, help="excite this band [Hz] instead")
    parser.add_argument(
        "--share", metavar=("LOW", "HIGH"), type=float, nargs=2, default=(0.1, 2.0), help="band over bandwidth (0.1 2)"
    )
    parser.add_argument("--duration", metavar="SECONDS", type=float, default=50.0, help="of the signal (default 50)")
    parser.add_argument("--rate", metavar="HZ", type=float, default=1000.0, help="samples per second (default 1000)")
    parser.add_argument("--seed", metavar="N", type=int, default=1, help="draws random phases (default 1)")
    parser.add_argument("--realisations", metavar="N", type=int, default=1, help="plans that differ in the seed")
    parser.add_argument("--part", metavar="PART", type=float, default=1.0, help="of the largest amplitude (default 1)")
    parser.add_argument("--centre", metavar="M", type=float, default=0.0, help="around which the piston moves")
    opt.add_limit_options(parser, "model")
    return opt.run(parser, _design, _show, argv, bulky=("traces", "spectrum"))


def _design(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    if options.realisations < 1 or not 0.0 < options.part <= 1.0:
        raise cli.UsageError("--realisations is 1 or more, --part above 0 and up to 1")
    model = load_model(options.model)
    bandwidth = options.bandwidth
    if options.probe:
        bandwidth = from_simulation(model, load_plan(options.probe))[0].position
    elif bandwidth is None and options.band is None:
        bandwidth = from_model(model, options.centre).position
    low, high = options.band or (options.share[0] * bandwidth, options.share[1] * bandwidth)
    limits = replace(Limits.of(model, options.centre), **opt.given_limits(options))
    names = [options.signal]
    if options.realisations > 1:
        names = [f"{options.signal}_{number}" for number in range(1, options.realisations + 1)]
    files = [f"{name}.yaml" for name in names]
    opt.check_new(options.out, *files, what="plan")
    say("simulating")
    sized: list[Sized] = []
    for number, name in enumerate(names):
        wish = Wish(low, high, options.duration, options.rate, options.seed + number)
        plan = replace(propose(options.signal, wish), name=name, centre=options.centre)
        sized.append(largest(plan, model, limits, options.part))
    if len(sized) > 1:  # realisations of one distribution have one amplitude: the least that any of them allows
        sized = _alike(sized, model, limits)
    result = document(sized, [str(options.out / file) for file in files], bandwidth, (low, high), limits)
    return opt.Done(result, {file: partial(save_plan, one.plan) for file, one in zip(files, sized, strict=True)})


def _alike(sized: list[Sized], model: Model, limits: Limits) -> list[Sized]:
    """All with the amplitude of the smallest, and with its reason."""
    least = min(sized, key=lambda one: one.plan.signal.size)
    found = []
    for one in sized:
        capped = largest(one.plan, model, limits, cap=least.plan.signal.size / one.plan.signal.size)
        assert capped.plan.prediction is not None and least.plan.prediction is not None
        prediction = replace(capped.plan.prediction, limited_by=least.plan.prediction.limited_by)
        found.append(replace(capped, plan=replace(capped.plan, prediction=prediction)))
    return found


def _show(result: dict[str, Any], console: Console) -> None:
    rows = []
    for plan in result["plans"]:
        p = plan["prediction"]
        name = plan["name"].rpartition("_")[2] if len(result["plans"]) > 1 else plan["name"]
        position = span(p["position_min"], p["position_max"], "m")
        pressures = span(p["pressure_min"], p["pressure_max"], "Pa")
        drive, speed = quantity(p["drive_peak"], "V"), quantity(p["velocity_peak"], "m/s")
        rows.append((name, f"±{drive}", position, speed, pressures))
    columns = ("|plan", ">|drive", ">|position", ">|speed", ">|pressures")
    console.print(tables.table(f"{result['signal']} on {result['model']['name']}, predicted", columns, rows))
    console.print(result["verdict"]["text"])
