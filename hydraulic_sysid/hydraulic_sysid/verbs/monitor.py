"""Follow one actuator over many bags: which parameter changes, since when, and when it reaches a limit.

Fits the effects that grow with wear (or what --watch names) to each bag by itself, tests each parameter for a change
with a stated rate of false alarms, and forecasts to the limits given. Bags are fitted on all processors (or a Dask
cluster) and once only: the same call with more bags fits the new ones. Writes monitor.json and a page (report.html).
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_node_utils import cli, tables
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.units import to_si
from hydraulic_sysid import campaign
from hydraulic_sysid.campaign.manifest import record_groups
from hydraulic_sysid.data.display import quantity
from hydraulic_sysid.data.records.formats import suffix_of
from hydraulic_sysid.monitoring import document, estimates
from hydraulic_sysid.verbs import _options as opt
from hydraulic_sysid.verbs._campaign_options import add_crew_options, chosen_crew

EPILOG = """\
examples:
  python -m hydraulic_sysid monitor --model my.yaml --record 'bags/*' --out runs/monitored
  python -m hydraulic_sysid monitor --model my.yaml --record 'bags/*' --watch internal_leakage entrained_air \\
      --limit 'internal_leakage.coefficient=2e-12 m^3/(s*Pa)' --out runs/monitored

exit codes: 0 nothing has changed; 1 something has; 2 unusable input
"""
_BAGS_PER_ALARM, _BASELINE, _LEAST = 200.0, 5, 3


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("monitor", __doc__, EPILOG)
    opt.add_model_option(parser)
    _add_bag_options(parser)
    parser.add_argument("--limit", metavar="KEY=VALUE", nargs="+", default=[], help="limits to forecast to, with units")
    parser.add_argument(
        "--bags-per-false-alarm", metavar="N", type=cli.positive, default=_BAGS_PER_ALARM,
        help=f"bags without a change until a false alarm (default {_BAGS_PER_ALARM:g})",
    )  # fmt: skip
    parser.add_argument(
        "--baseline", metavar="N", type=int, default=_BASELINE, help=f"first bags, without alarm (default {_BASELINE})"
    )
    add_crew_options(parser)
    return opt.run(parser, _monitor, _show, argv)


def _add_bag_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--record", metavar="PATTERN", nargs="+", required=True,
        help="bags, in the order of their times or else of their names; each match of a pattern is one",
    )  # fmt: skip
    parser.add_argument("--columns", metavar="MAP", help="column map of records that are tables")
    parser.add_argument(
        "--watch", metavar="NAME", nargs="+", default=[],
        help="effects or parameters to follow (default: the effects that grow with wear)",
    )  # fmt: skip


def _monitor(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    if options.baseline < _LEAST:
        raise cli.UsageError(
            f"--baseline is {options.baseline}; at least {_LEAST} bags are needed to know their scatter"
        )
    model = load_model(options.model)
    names = estimates.watched(model, options.watch)
    followed, keys = estimates.followed(model, names)
    limits = _limits(options.limit, followed, keys)
    bags = {_short(name): paths[0] for name, paths in record_groups(options.record, Path(), "--record").items()}
    cases = estimates.bag_cases(options.model, bags, options.columns, names)
    outcomes = campaign.run(
        estimates.estimate, cases, options.out.resolve() / "monitor_bags", chosen_crew(options),
        lambda p: say(f"bag {p.before + p.now} of {p.total}"),
    )  # fmt: skip
    if all(o.failed for o in outcomes):
        raise cli.UsageError(f"no bag could be fitted; the first: {outcomes[0].error.strip().rpartition(chr(10))[2]}")
    result = document.monitored(followed, outcomes, limits, options.bags_per_false_alarm, options.baseline)
    return opt.Done(result, good=not result["changed"])


def _short(name: str) -> str:
    return name.removesuffix(suffix_of(Path(name)))


def _limits(texts: list[str], model: Model, keys: list[str]) -> dict[str, float]:
    found = {}
    for text in texts:
        key, _, value = text.partition("=")
        if key not in keys:
            raise cli.UsageError(f"--limit {text!r}: {key!r} is not followed; followed are {', '.join(keys)}")
        found[key] = to_si(value, model.parameter(key).unit, f"--limit {key}")
    return found


def _show(result: dict[str, Any], console: Console) -> None:
    table = tables.table(result["title"], ("|parameter", ">last", "|changed since", ">before"))
    for r in result["parameters"]:
        alarm = r["alarm"]
        cells = (alarm["onset"], quantity(alarm["before"], r["unit"])) if alarm else ("–", "–")
        table.add_row(r["key"], quantity(float(r["values"][-1]), r["unit"], error=float(r["errors"][-1])), *cells)
    console.print(table)
    console.print(result["verdict"]["text"], markup=False)
