"""Say which balance of a (calibrated) model the measurement breaks, by how much, over what, and whose it is.

Forms the balances of force and flow from the measured signals, beside those of an exact model under the same noise,
and shares out what is missing among forces, leakage, oil, valve, supply and sensors. Writes locate.json and a page
(report.html) into a folder.
"""

from __future__ import annotations

import argparse
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.display import first_upper, number, percent, quantity
from hydraulic_sysid.diagnosis.locate import locate
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid locate --model runs/calibrated/model.yaml --record examples/sample_bench --out runs/located
"""
_BULKY = ("error_maps", "spectrum", "lag", "cross_lag", "autocorrelation", "exact_autocorrelation", "cross_correlation")


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("locate", __doc__, EPILOG)
    opt.add_model_option(parser, "model file (calibrated), or name of a preset")
    opt.add_record_options(parser)
    return opt.run(parser, _locate, _show, argv, _BULKY)


def _locate(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    model = load_model(options.model)
    return opt.Done(locate(model, opt.read_records(options), lambda name: say(f"forming the balances of {name}")))


def _show(result: dict[str, Any], console: Console) -> None:
    balances = [
        (
            first_upper(b["title"]), quantity(b["residual_rms"], b["unit"]), quantity(b["exact_rms"], b["unit"]),
            f"{number(b['ratio'])}×", f"below {number(b['band'][1])} Hz",
        )
        for b in result["balances"]
    ]  # fmt: skip
    if balances:
        columns = ("|balance", ">|residual RMS", ">|noise", ">|ratio", ">|band")
        console.print(tables.table(f"{result['model']['name']}: balances", columns, balances))
    shares = [(s["name"], percent(s["share"]), percent(s["alone"])) for s in result["attribution"]]
    if shares:
        title = "what each subsystem explains of what is missing"
        console.print(tables.table(title, ("subsystem", ">share", ">alone"), shares))
    console.print(result["verdict"]["text"])
    for finding in result["findings"]:
        if finding["kind"] != "at_noise":
            console.print(f"- {finding['text']}")
