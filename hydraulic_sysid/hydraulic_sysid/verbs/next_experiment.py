"""Design the experiment that tells competing models apart, for what a diagnosis could not decide.

Every model is refitted as well as it can be before it counts as different; travel, pressures, velocity and drive keep
their limits on every one. Writes the plan for the excitation node, its drive, next_experiment.json and a page.
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sim.trust import add_trust_option
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import number, span
from hydraulic_sysid.diagnosis.next_experiment import NextExperimentError, competing, limits_of, next_experiment
from hydraulic_sysid.estimation.noise import noise_std
from hydraulic_sysid.estimation.segments import MEASURED
from hydraulic_sysid.verbs import _options as opt

PLAN = "next_experiment.yaml"
EPILOG = """\
examples:
  python -m hydraulic_sysid next_experiment --diagnosis runs/diagnosed --out runs/next
  python -m hydraulic_sysid next_experiment --model a.yaml b.yaml --record old.csv --out runs/next
  python -m hydraulic_sysid next_experiment --model a.yaml b.yaml --noise position=2e-5 --seconds 30 --out runs/next

The plan is played by the excitation node: -p plan:=runs/next/next_experiment.yaml
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("next_experiment", __doc__, EPILOG)
    models = parser.add_mutually_exclusive_group(required=True)
    models.add_argument(
        "--diagnosis", metavar="DIR", type=Path, help="folder of a diagnosis that names several effects"
    )
    models.add_argument("--model", metavar="FILE", nargs="+", help="files of the competing models, fitted, two or more")
    add_trust_option(parser)
    opt.add_record_options(parser, required=False, window=False)
    parser.add_argument(
        "--noise", metavar="CHANNEL=SIGMA", nargs="+", default=[],
        help="measured channels and their noise [m, Pa] (default: from the diagnosis, or from --record)",
    )  # fmt: skip
    parser.add_argument("--seconds", metavar="SECONDS", type=float, default=20.0, help="of the drive (default 20)")
    parser.add_argument("--rate", metavar="HZ", type=float, default=1000.0, help="samples per second (default 1000)")
    parser.add_argument("--centre", metavar="M", type=float, default=0.0, help="around which the piston moves")
    parser.add_argument("--segment", "--piece", metavar="S", type=float, help="of segments (default: the diagnosis's)")
    opt.add_limit_options(parser, "models")
    return opt.run(parser, _design, _show, argv, bulky=("traces", "differences"))


def _design(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    opt.check_new(options.out, PLAN, "next_experiment.csv", what="plan")
    diagnosis: dict[str, Any] = {}
    if options.diagnosis:
        file = options.diagnosis / "diagnose.json" if options.diagnosis.is_dir() else options.diagnosis
        diagnosis = results.read_result(file)
    models = competing.of_diagnosis(file.parent, diagnosis) if diagnosis else competing.of_files(options.model)
    noise = _noise(options, diagnosis)
    limits = replace(limits_of(models, options.centre), **opt.given_limits(options))
    length = options.segment or float(diagnosis.get("settings", {}).get("segment_length", 0.5))
    proposal = next_experiment(
        models, limits, noise, options.seconds, lambda text: say(f"designing: {text}"),
        centre=options.centre, rate=options.rate, segment_length=length,
    )  # fmt: skip
    result = {**proposal.document, "file": str(options.out / PLAN)}
    return opt.Done(result, {PLAN: lambda file: proposal.save(file.parent)}, result["verdict"]["level"] != "off")


def _noise(options: argparse.Namespace, diagnosis: dict[str, Any]) -> dict[str, float]:
    """Standard deviation per channel: as given, else of the record, else as the diagnosis found it."""
    if options.noise:
        found = {}
        for item in options.noise:
            channel, _, value = item.partition("=")
            try:
                found[channel] = float(value)
            except ValueError:
                raise NextExperimentError(f"--noise {item}: allowed is CHANNEL=NUMBER, as position=2e-5") from None
        return found
    if options.record:
        records = opt.read_records(options)
        channels = [c for c in MEASURED if all(c in r for r in records)]
        return {c: statistics.median(noise_std(r[c]) for r in records) for c in channels}
    if diagnosis:
        return {c: statistics.median(by_record.values()) for c, by_record in diagnosis["noise_std"].items()}
    raise NextExperimentError("which channels are measured, and how noisy? Name a --record, or --noise CHANNEL=SIGMA …")


def _show(result: dict[str, Any], console: Console) -> None:
    rows = [
        (
            p["true"], p["refitted"], number(p["separation"]),
            "< 1e-9" if p["misclassification_probability"] < 1e-9 else f"{p['misclassification_probability']:.1g}",
            number(p["seconds_needed"]),
        )
        for p in result["pairs"]
    ]  # fmt: skip
    columns = ("|true", "|refitted to it", ">|apart [σ]", ">|mistaken", ">|needs [s]")
    console.print(tables.table("what the experiment decides, predicted", columns, rows))
    p = result["prediction"]
    console.print(
        f"position {span(p['position_min'], p['position_max'], 'm')}, "
        f"pressures {span(p['pressure_min'], p['pressure_max'], 'Pa')}, on every model"
    )
    console.print(result["verdict"]["text"])
