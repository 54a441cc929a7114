"""Play an excitation plan on the model before it is played on the bench, and say whether it may be.

Checks that the run completes, that travel, drive and pressures keep their limits, and which free parameters its record
will identify. Writes rehearse.json and a page (report.html) into a folder.
"""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.diagnosis.rehearsal import rehearse
from hydraulic_sysid.excitation import load_plan
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid rehearse chirp --model moog_mcr_m_1002_bench --out runs/rehearsed
  python -m hydraulic_sysid rehearse runs/next/next_experiment.yaml --model my.yaml --position 0.1 --out runs/rehearsed

exit codes: 0 the experiment may be played; 1 it may not; 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("rehearse", __doc__, EPILOG)
    parser.add_argument("plan", metavar="PLAN", help="excitation plan: a file, or the name of a shipped one")
    opt.add_model_option(parser)
    parser.add_argument("--position", metavar="M", type=float, help="where the piston stands (default: at the centre)")
    return opt.run(parser, _rehearse, _show, argv, bulky=("traces",))


def _rehearse(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    plan, model = load_plan(options.plan), load_model(options.model)
    result = rehearse(plan, model, options.position, say)
    return opt.Done(result, good=result["verdict"]["go"])


def _show(result: dict[str, Any], console: Console) -> None:
    rows = [(check["title"], check["level"], check["text"]) for check in result["checks"]]
    console.print(
        tables.table(f"{result['plan']['name']} on {result['model']['name']}", ("|check", "|level", "found"), rows)
    )
    console.print(result["verdict"]["text"])
