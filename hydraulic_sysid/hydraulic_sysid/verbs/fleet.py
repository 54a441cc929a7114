"""Compare many actuators: which unit is out of family, in which parameter, and with what probability.

UNITS is a YAML file, unit → its records (patterns, relative to it), whose bags are fitted one by one as monitor does;
or a CSV table with the columns unit, parameter, measure (SI unit), value and error, of estimates made elsewhere. Writes
fleet.json and a page (report.html).
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path
from typing import Any

from rich.console import Console
from ruamel.yaml.error import YAMLError

from hydraulic_node_utils import cli, tables
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid import campaign
from hydraulic_sysid.campaign.manifest import read_yaml, record_groups
from hydraulic_sysid.data.display import number, percent, quantity
from hydraulic_sysid.monitoring import document, estimates
from hydraulic_sysid.monitoring.random_effects import pooled
from hydraulic_sysid.verbs import _options as opt
from hydraulic_sysid.verbs._campaign_options import add_crew_options, chosen_crew

EPILOG = """\
examples:
  python -m hydraulic_sysid fleet units.yaml --model my.yaml --out runs/fleet     # units.yaml: {left: [left/*], …}
  python -m hydraulic_sysid fleet estimates.csv --out runs/fleet

exit codes: 0 all units are of one family; 1 some are not; 2 unusable input
"""
_COLUMNS = ("unit", "parameter", "measure", "value", "error")
_LEAST = 4
_SHOWN = 12

Units = dict[str, dict[str, tuple[float, float]]]


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("fleet", __doc__, EPILOG)
    parser.add_argument(
        "units", metavar="UNITS", type=Path, help="units with their records (.yaml), or estimates (.csv)"
    )
    parser.add_argument("--model", metavar="FILE", help="model file of the units, or a preset; for records")
    parser.add_argument("--columns", metavar="MAP", help="column map of records that are tables")
    parser.add_argument(
        "--watch", metavar="NAME", nargs="+", default=[],
        help="effects or parameters to compare (default: the effects that grow with wear)",
    )  # fmt: skip
    add_crew_options(parser)
    add_trust_option(parser)
    return opt.run(parser, _fleet, _show, argv)


def _fleet(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    if options.units.suffix == ".csv":
        units, measures = _table(options.units)
    else:
        units, measures = _fitted(options, say)
    if len(units) < _LEAST:
        raise cli.UsageError(f"{options.units}: {len(units)} units make no family; at least {_LEAST} are needed")
    result = document.compared(f"{len(units)} units", units, measures)
    return opt.Done(result, good=not result["verdict"]["units"])


def _table(file: Path) -> tuple[Units, dict[str, str]]:
    units: Units = {}
    measures: dict[str, str] = {}
    with file.open(encoding="utf-8", newline="") as stream:
        rows = csv.DictReader(stream)
        lacking = [c for c in _COLUMNS if c not in (rows.fieldnames or [])]
        if lacking:
            raise cli.UsageError(f"{file}: the columns {', '.join(lacking)} are missing; it has {rows.fieldnames}")
        for row in rows:
            where = f"{file}, row {rows.line_num}"
            try:
                value, error = float(row["value"]), float(row["error"])
            except (TypeError, ValueError):
                raise cli.UsageError(f"{where}: value and error must be numbers: {row}") from None
            if not (math.isfinite(value) and math.isfinite(error) and error >= 0.0):
                raise cli.UsageError(f"{where}: value {value}, error {error}; finite ones are allowed, errors from 0")
            if row["parameter"] in units.setdefault(row["unit"], {}):
                raise cli.UsageError(f"{where}: {row['parameter']} of {row['unit']} is there twice")
            units[row["unit"]][row["parameter"]] = (value, error)
            measures[row["parameter"]] = row["measure"]
    return units, measures


def _fitted(options: argparse.Namespace, say: opt.Say) -> tuple[Units, dict[str, str]]:
    if not options.model:
        raise cli.UsageError("--model is needed to fit records")
    try:
        content = read_yaml(options.units.read_text(encoding="utf-8"))
    except YAMLError as error:
        raise cli.UsageError(f"{options.units} is no YAML: {error}") from error
    if not isinstance(content, dict) or not all(isinstance(v, list) for v in content.values()):
        raise cli.UsageError(
            f"{options.units}: allowed is unit → list of records, {{left: [left/*], right: [right/*]}}"
        )
    groups = record_groups(content, options.units.parent, str(options.units))
    names = estimates.watched(load_model(options.model), options.watch)
    bags = {f"{unit}: {path}": path for unit, paths in groups.items() for path in paths}
    cases = estimates.bag_cases(options.model, bags, options.columns, names)
    outcomes = campaign.run(
        estimates.estimate, cases, options.out.resolve() / "fleet_bags", chosen_crew(options),
        lambda p: say(f"bag {p.before + p.now} of {p.total}"),
    )  # fmt: skip
    units: Units = {}
    measures: dict[str, str] = {}
    for unit in groups:
        series = estimates.gathered([o for o in outcomes if o.labels["bag"].startswith(f"{unit}: ")])
        for e in series:
            mean, spread = float(e.values[0]), float(e.errors[0])
            if len(e.values) > 1:
                family = pooled(e.values, e.errors)
                mean, spread = family.mean, family.error
            units.setdefault(unit, {})[e.key] = (mean, spread)
            measures[e.key] = e.unit
    return units, measures


def _show(result: dict[str, Any], console: Console) -> None:
    table = tables.table(result["title"], ("|unit", "|parameter", ">value", ">distance [σ]", ">out of family"))
    for r in result["rows"][:_SHOWN]:
        value = quantity(r["value"], r["measure"], error=r["error"])
        table.add_row(r["unit"], r["parameter"], value, number(r["distance"], 2), percent(r["probability"]))
    console.print(table)
    console.print(result["verdict"]["text"], markup=False)
