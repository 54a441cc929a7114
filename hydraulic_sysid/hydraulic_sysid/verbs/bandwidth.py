"""The actuator's bandwidth: of a model file, of a probe played on the model, or of a probe's record.

The position bandwidth (closed loop at half the critical gain) is what excitations are chosen from; the velocity
bandwidth (−3 dB of the velocity) is told beside it. Writes bandwidth.json and a page.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

from rich.console import Console

from hydraulic_node_utils import cli, tables
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid.data.display import number
from hydraulic_sysid.excitation import load_plan
from hydraulic_sysid.linear import bandwidth
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid bandwidth --model moog_mcr_m_1002_bench --out runs/bandwidth
  python -m hydraulic_sysid bandwidth --model my.yaml --probe probe --out runs/probed
  python -m hydraulic_sysid bandwidth --record runs/probe-bag --out runs/measured

A record is one of the shipped plan "probe", or of any other periodic excitation that reaches the bandwidth. On the
running bench the excitation node measures it: service ~/measure_bandwidth, result on ~/bandwidth.
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("bandwidth", __doc__, EPILOG)
    opt.add_record_options(parser, required=False, window=False)
    parser.add_argument("--model", metavar="FILE", help="model file, or the name of a preset")
    add_trust_option(parser)
    parser.add_argument("--probe", metavar="PLAN", help="play this plan on the model instead of linearising it")
    parser.add_argument("--position", metavar="M", type=float, default=0.0, help="of the piston (default: mid stroke)")
    opt.add_period_options(parser)
    return opt.run(parser, _bandwidth, _show, argv, bulky=("frequency", "response", "closed_loop", "coherence"))


def _bandwidth(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    if bool(options.record) == bool(options.model):
        raise cli.UsageError("name either a --model or a --record")
    if options.probe and not options.model:
        raise cli.UsageError("--probe is played on a --model")
    coherence = None
    if options.model:
        model = load_model(options.model)
        source = {"kind": "model", "name": model.name, "path": str(model.path or "")}
        if options.probe:
            source["kind"] = "simulation"
            found, coherence = bandwidth.from_simulation(model, load_plan(options.probe))
        else:
            found = bandwidth.from_model(model, options.position)
    else:
        records = opt.read_records(options)
        if len(records) > 1:
            raise cli.UsageError(f"one record is measured at a time; there are {len(records)}")
        found, coherence = bandwidth.from_record(records[0], options.period, options.start)
        source = {"kind": "record", "name": records[0].name, "path": str(records[0].source)}
    return opt.Done(bandwidth.document(found, source, coherence))


def _show(result: dict[str, Any], console: Console) -> None:
    rows = [
        ("position, closed loop", f"{number(result['position_bandwidth'])} Hz"),
        ("velocity, open loop", _velocity(result)),
        ("velocity gain", f"{number(1e3 * result['velocity_gain'])} mm/(s·V)"),
        ("critical gain", f"{number(result['critical_gain'])} V/m at {number(result['phase_crossover'])} Hz"),
    ]
    source = result["source"]
    console.print(tables.table(f"bandwidth of {source['name']} ({source['kind']})", ("", ">"), rows))
    console.print(result["verdict"]["text"])


def _velocity(result: dict[str, Any]) -> str:
    found = result["velocity_bandwidth"]
    return f"{number(found)} Hz" if math.isfinite(found) else f"beyond {number(result['frequency'][-1])} Hz"
