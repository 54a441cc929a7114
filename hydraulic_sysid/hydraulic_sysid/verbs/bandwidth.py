"""The actuator's bandwidth: of a model file, of a probe played on the model, or of a probe's record.

The position bandwidth (closed loop at half the critical gain) is what excitations are chosen from; the velocity
bandwidth (−3 dB of the velocity) is told beside it. Writes bandwidth.json and a page.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import number
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.excitation import load_plan
from hydraulic_sysid.linear import bandwidth
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, summary_json

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
    parser = cli.parser("bandwidth", __doc__.partition("\n")[0], EPILOG)
    cli.add_record_options(parser, required=False)
    parser.add_argument("--model", metavar="FILE", help="model file, or the name of a preset")
    parser.add_argument("--probe", metavar="PLAN", help="play this plan on the model instead of linearising it")
    parser.add_argument("--position", metavar="M", type=float, default=0.0, help="of the piston (default: mid stroke)")
    parser.add_argument("--period", metavar="SECONDS", type=float, help="of the excitation, where no plan tells it")
    parser.add_argument("--start", metavar="SECONDS", type=float, default=0.0, help="where its periods begin")
    add_folder_options(parser)
    return cli.run(parser, _bandwidth, argv, errors=(ModelError, SimulationError, results.ResultError))


def _bandwidth(options: argparse.Namespace) -> int:
    if bool(options.record) == bool(options.model):
        raise cli.UsageError("name either a --model or a --record")
    if options.probe and not options.model:
        raise cli.UsageError("--probe is played on a --model")
    results.check_target(options.out, "bandwidth")
    coherence = None
    if options.model:
        model = load_model(options.model)
        source = {"kind": "model", "name": model.name, "path": str(model.path or "")}
        if options.probe:
            source["kind"] = "simulation"
            found, coherence = bandwidth.from_rehearsal(model, load_plan(options.probe))
        else:
            found = bandwidth.from_model(model, options.position)
    else:
        records = read_all(options.record, options.columns)
        if len(records) > 1:
            raise cli.UsageError(f"one record is measured at a time; there are {len(records)}")
        found, coherence = bandwidth.from_record(records[0], options.period, options.start)
        source = {"kind": "record", "name": records[0].name, "path": str(records[0].source)}
    result = bandwidth.document(found, source, coherence)
    results.write_result(options.out, result)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(result, ("frequency", "response", "closed_loop", "coherence")))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{page}")
    return cli.OK


def _print(result: dict[str, Any], console: Console) -> None:
    table = Table(title=f"bandwidth of {result['source']['name']} ({result['source']['kind']})", title_justify="left")
    table.add_column("")
    table.add_column("", justify="right")
    table.add_row("position, closed loop", f"{number(result['position_bandwidth'])} Hz")
    table.add_row("velocity, open loop", _velocity(result))
    table.add_row("velocity gain", f"{number(1e3 * result['velocity_gain'])} mm/(s·V)")
    table.add_row("critical gain", f"{number(result['critical_gain'])} V/m at {number(result['phase_crossover'])} Hz")
    console.print(table)
    console.print(result["verdict"]["text"])


def _velocity(result: dict[str, Any]) -> str:
    found = result["velocity_bandwidth"]
    return f"{number(found)} Hz" if math.isfinite(found) else f"beyond {number(result['frequency'][-1])} Hz"


if __name__ == "__main__":
    sys.exit(main())
