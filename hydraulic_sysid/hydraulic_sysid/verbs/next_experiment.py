"""Design the experiment that tells rival models apart, for what a diagnosis could not decide.

Every rival is refitted as well as it can be before it counts as different; travel, pressures, velocity and drive keep
their limits on every rival. Writes the plan for the excitation node, its drive, next_experiment.json and a page.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import Model, load_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.display import number, span
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import CalibrationError
from hydraulic_sysid.diagnosis.next_experiment import NextExperimentError, limits_of, next_experiment
from hydraulic_sysid.estimation.noise import noise_floor
from hydraulic_sysid.estimation.segments import MEASURED
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, summary_json
from .design import _LIMITS

EPILOG = """\
examples:
  python -m hydraulic_sysid next_experiment --diagnosis runs/diagnosed --out runs/next
  python -m hydraulic_sysid next_experiment --model a.yaml b.yaml --record old.csv --out runs/next
  python -m hydraulic_sysid next_experiment --model a.yaml b.yaml --noise position=2e-5 --seconds 30 --out runs/next

The plan is played by the excitation node: -p plan:=runs/next/next_experiment.yaml
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("next_experiment", __doc__.partition("\n")[0], EPILOG)
    rivals = parser.add_mutually_exclusive_group(required=True)
    rivals.add_argument(
        "--diagnosis", metavar="DIR", type=Path, help="folder of a diagnosis that names several effects"
    )
    rivals.add_argument("--model", metavar="FILE", nargs="+", help="the rivals' model files, fitted, two or more")
    cli.add_record_options(parser, required=False)
    parser.add_argument(
        "--noise", metavar="CHANNEL=SIGMA", nargs="+", default=[],
        help="measured channels and their noise [m, Pa] (default: from the diagnosis, or from --record)",
    )  # fmt: skip
    parser.add_argument("--seconds", metavar="SECONDS", type=float, default=20.0, help="of the drive (default 20)")
    parser.add_argument("--rate", metavar="HZ", type=float, default=1000.0, help="samples per second (default 1000)")
    parser.add_argument("--centre", metavar="M", type=float, default=0.0, help="around which the piston moves")
    parser.add_argument("--piece", metavar="SECONDS", type=float, help="length of a piece (default: the diagnosis's)")
    for name, (unit, what) in _LIMITS.items():
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(option, metavar=unit, type=float, help=f"{what} (default: from the models)")
    add_folder_options(parser)
    errors = (ModelError, SimulationError, CalibrationError, results.ResultError)
    return cli.run(parser, _design, argv, errors=errors)


def _design(options: argparse.Namespace) -> int:
    results.check_target(options.out, "next_experiment")
    for file in (options.out / "next_experiment.yaml", options.out / "next_experiment.csv"):
        if file.exists():
            raise NextExperimentError(f"{file} exists; choose another folder (a plan is never overwritten)")
    diagnosis = _diagnosis(options.diagnosis) if options.diagnosis else None
    rivals = _tied(options.diagnosis, diagnosis) if diagnosis else _named(options.model)
    noise = _noise(options, diagnosis)
    given = {k: getattr(options, k) for k in _LIMITS if getattr(options, k) is not None}
    limits = replace(limits_of(rivals, options.centre), **given)
    piece = options.piece or float((diagnosis or {}).get("settings", {}).get("segment_length", 0.5))
    with Console(stderr=True).status("designing …") as status:
        proposal = next_experiment(
            rivals, limits, noise, options.seconds, lambda text: status.update(f"designing: {text} …"),
            centre=options.centre, rate=options.rate, piece=piece,
        )  # fmt: skip
    file = proposal.save(options.out)
    result = {**proposal.document, "file": str(file)}
    results.write_result(options.out, result)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(result, ("traces", "differences")))
    else:
        _print(result, Console(file=sys.stdout, highlight=False, markup=False))
        print(f"\n{file}\n{page}")
    return cli.OK if result["verdict"]["level"] != "off" else cli.NEGATIVE


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
        records = read_all(options.record, options.columns)
        channels = [c for c in MEASURED if all(c in r for r in records)]
        return {c: statistics.median(noise_floor(r[c]) for r in records) for c in channels}
    if diagnosis is not None:
        return {c: statistics.median(by_record.values()) for c, by_record in diagnosis["noise_std"].items()}
    raise NextExperimentError("which channels are measured, and how noisy? Name a --record, or --noise CHANNEL=SIGMA …")


def _print(result: dict[str, Any], console: Console) -> None:
    table = Table(title="what the experiment decides, predicted", title_justify="left")
    for title in ("true", "refitted to it", "apart [σ]", "mistaken", "needs [s]"):
        table.add_column(title, justify="left" if title in ("true", "refitted to it") else "right", no_wrap=True)
    for p in result["pairs"]:
        mistaken = (
            "< 1e-9" if p["misclassification_probability"] < 1e-9 else f"{p['misclassification_probability']:.1g}"
        )
        table.add_row(p["true"], p["refitted"], number(p["separation"]), mistaken, number(p["seconds_needed"]))
    console.print(table)
    p = result["prediction"]
    console.print(
        f"position {span(p['position_min'], p['position_max'], 'm')}, "
        f"pressures {span(p['pressure_min'], p['pressure_max'], 'Pa')}, on every rival"
    )
    console.print(result["verdict"]["text"])


if __name__ == "__main__":
    sys.exit(main())
