"""Design the experiment that tells rival models apart, for what a diagnosis could not decide.

Every rival is refitted as well as it can be before it counts as different; travel, pressures, velocity and drive keep
their limits on every rival. Writes the plan for the excitation node, its drive, next_experiment.json and a page.
"""

from __future__ import annotations

import argparse
import statistics
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sim.model_file import Model, load_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import number, span
from hydraulic_sysid.diagnosis.next_experiment import NextExperimentError, limits_of, next_experiment
from hydraulic_sysid.estimation.noise import noise_floor
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
    rivals = parser.add_mutually_exclusive_group(required=True)
    rivals.add_argument(
        "--diagnosis", metavar="DIR", type=Path, help="folder of a diagnosis that names several effects"
    )
    rivals.add_argument("--model", metavar="FILE", nargs="+", help="the rivals' model files, fitted, two or more")
    opt.add_record_options(parser, required=False, window=False)
    parser.add_argument(
        "--noise", metavar="CHANNEL=SIGMA", nargs="+", default=[],
        help="measured channels and their noise [m, Pa] (default: from the diagnosis, or from --record)",
    )  # fmt: skip
    parser.add_argument("--seconds", metavar="SECONDS", type=float, default=20.0, help="of the drive (default 20)")
    parser.add_argument("--rate", metavar="HZ", type=float, default=1000.0, help="samples per second (default 1000)")
    parser.add_argument("--centre", metavar="M", type=float, default=0.0, help="around which the piston moves")
    parser.add_argument("--piece", metavar="SECONDS", type=float, help="length of a piece (default: the diagnosis's)")
    opt.add_limit_options(parser, "models")
    return opt.run(parser, _design, _show, argv, bulky=("traces", "differences"))


def _design(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    opt.check_new(options.out, PLAN, "next_experiment.csv", what="plan")
    diagnosis = _diagnosis(options.diagnosis) if options.diagnosis else None
    rivals = _tied(options.diagnosis, diagnosis) if diagnosis else _named(options.model)
    noise = _noise(options, diagnosis)
    limits = replace(limits_of(rivals, options.centre), **opt.given_limits(options))
    piece = options.piece or float((diagnosis or {}).get("settings", {}).get("segment_length", 0.5))
    proposal = next_experiment(
        rivals, limits, noise, options.seconds, lambda text: say(f"designing: {text}"),
        centre=options.centre, rate=options.rate, piece=piece,
    )  # fmt: skip
    result = {**proposal.document, "file": str(options.out / PLAN)}
    return opt.Done(result, {PLAN: lambda file: proposal.save(file.parent)}, result["verdict"]["level"] != "off")


def _diagnosis(folder: Path) -> dict[str, Any]:
    return results.read_result(folder / "diagnose.json" if folder.is_dir() else folder)


def _tied(folder: Path, diagnosis: dict[str, Any]) -> dict[str, Model]:
    """The models between which the diagnosis could not decide: ``competing_<effect>.yaml``, or its own model."""
    folder = folder if folder.is_dir() else folder.parent
    files = {file.stem.removeprefix("competing_"): file for file in sorted(folder.glob("competing_*.yaml"))}
    rivals = {name: load_model(str(file)) for name, file in files.items()}
    own = folder / "model.yaml"
    if own.is_file():
        model = load_model(str(own))
        left = [n for n in diagnosis["verdict"].get("effects", ()) if n not in rivals and n in model.effects]
        if left:
            rivals = {"+".join(left): model, **rivals}
    if len(rivals) < 2:
        text = diagnosis["verdict"].get("text", "")
        raise NextExperimentError(
            f"{folder}: holds {len(rivals)} competing models (competing_<effect>.yaml, model.yaml); two or more are "
            f"needed. Its verdict: {text}"
        )
    return rivals


def _named(files: list[str]) -> dict[str, Model]:
    """Models by what only they have on, or by their files' names where that is not unique."""
    models = [load_model(file) for file in files]
    common = set.intersection(*(set(m.effects) for m in models))
    names = ["+".join(e for e in m.effects if e not in common) for m in models]
    if len(set(names)) < len(names) or "" in names:
        names = [Path(file).stem for file in files]
    if len(set(names)) < len(names):
        raise NextExperimentError(f"the same model twice: {', '.join(files)}")
    return dict(zip(names, models, strict=True))


def _noise(options: argparse.Namespace, diagnosis: dict[str, Any] | None) -> dict[str, float]:
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
        return {c: statistics.median(noise_floor(r[c]) for r in records) for c in channels}
    if diagnosis is not None:
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
        f"pressures {span(p['pressure_min'], p['pressure_max'], 'Pa')}, on every rival"
    )
    console.print(result["verdict"]["text"])
