"""Find out which physical effect a model lacks to explain its records.

Fits what the model calls free, tries every effect of the library that is off, and says what is missing, what these
data cannot tell apart, that nothing is missing, or what shape it has that no effect explains. What counts must lower
the error on data that no fit has seen. Writes diagnose.json and a page (report.html); with --apply also model.yaml,
the model with what was found; for a verdict with several names each rival's model (competing_EFFECT.yaml).
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import Settings
from hydraulic_sysid.diagnosis.search import DiagnosisError, diagnose
from hydraulic_sysid.verbs import _cli as cli

from .compare import add_folder_options, add_window_option, read_window, summary_json

MODEL = "model.yaml"
LONG = ("worst_segments",)
EPILOG = """\
examples:
  python -m hydraulic_sysid diagnose --model sample_bench --record examples/sample_bench --out runs/diagnosed
  python -m hydraulic_sysid diagnose --model my.yaml --record a.csv b.csv --holdout c.csv --apply --out runs/mine

exit codes: 0 nothing is missing, or what is missing was found and named; 1 something is left that was not named
(outside the library, or effects that these data cannot tell apart); 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("diagnose", __doc__.partition("\n")[0], EPILOG)
    add_diagnosis_options(parser)
    parser.add_argument("--apply", action="store_true", help=f"write the model with what was found ({MODEL})")
    return cli.run(parser, _diagnose, argv, errors=(ModelError, SimulationError, DiagnosisError, results.ResultError))


def add_diagnosis_options(parser: argparse.ArgumentParser) -> None:
    """Model, records, held-out records, length of a piece, folder."""
    parser.add_argument("--model", metavar="FILE", required=True, help="model file, or the name of a preset")
    cli.add_record_options(parser)
    add_window_option(parser)
    parser.add_argument(
        "--holdout",
        metavar="PATH",
        type=cli.Path,
        nargs="+",
        help="records that no fit sees (default: every third stretch of every record)",
    )
    parser.add_argument("--piece", metavar="SECONDS", type=float, default=0.5, help="length of a piece (default 0.5)")
    add_folder_options(parser)


def check_target(options: argparse.Namespace, verb: str, names: tuple[str, ...]) -> None:
    """A model is never overwritten."""
    results.check_target(options.out, verb)
    for name in names:
        if (options.out / name).exists():
            raise DiagnosisError(f"{options.out / name} exists; choose another folder (a model is never overwritten)")


def _diagnose(options: argparse.Namespace) -> int:
    check_target(options, "diagnose", (MODEL,) if options.apply else ())
    stale = sorted(options.out.glob("competing_*.yaml")) if options.out.is_dir() else []
    if stale:
        raise DiagnosisError(f"{stale[0]} exists; choose another folder (a model is never overwritten)")
    model = load_model(options.model)
    records = read_window(options)
    held_out = read_all(options.holdout, options.columns) if options.holdout else []
    with Console(stderr=True).status("diagnosing …") as status:
        done = diagnose(
            model, records, held_out, Settings(length=options.piece), lambda text: status.update(f"{text} …")
        )
    results.write_result(options.out, done.result)
    written = []
    if options.apply:
        written.append(options.out / MODEL)
        save_model(done.model, written[-1])
    for name, rival in done.rivals.items():
        written.append(options.out / f"competing_{name}.yaml")
        save_model(rival, written[-1])
    if done.rivals:
        for name in done.result["verdict"]["effects"]:
            if name not in done.rivals:
                written.append(options.out / f"competing_{name}.yaml")
                save_model(done.model, written[-1])
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(done.result, LONG))
    else:
        show(done.result, Console(file=sys.stdout, highlight=False))
        print("\n" + "\n".join(str(p) for p in (*written, page)))
    return cli.OK if done.result["verdict"]["kind"] in ("missing", "complete") else cli.NEGATIVE


def show(result: dict[str, Any], console: Console) -> None:
    """The table and the sentence a user reads in the terminal."""
    table = Table(title=f"{result['model']['name']}: residual over noise on validation data", title_justify="left")
    for title in ("", "effect", "acts on", "before", "after", "parameters"):
        table.add_column(title, justify="right" if title in ("before", "after") else "left")
    for row in result["effects"][:8]:
        found = "→" if row["added"] else ""
        values = ", ".join(
            f"{p['key'].split('.')[1]} {p['value']:.4g}{_error(p)}{'' if p['unit'] == '1' else ' ' + p['unit']}"
            for p in row["parameters"]
        )
        table.add_row(
            found,
            row["name"],
            row["subsystem"],
            f"{row['residual_before']:.4g}",
            f"{row['residual_after']:.4g}",
            values,
        )
    console.print(table)
    console.print(result["verdict"]["text"])


def _error(parameter: dict[str, Any]) -> str:
    error = parameter["standard_error"]
    return f" ± {error:.2g}" if error is not None and error < float("inf") else ""


if __name__ == "__main__":
    sys.exit(main())
