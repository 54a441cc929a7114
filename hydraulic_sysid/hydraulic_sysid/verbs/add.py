"""Add one effect to a model: fit it to records and see what it does to the error on data held out.

Writes add.json, a page (report.html) and the new model (model.yaml), whose history says what it was learned from.
"""

from __future__ import annotations

import argparse
import sys

from rich.console import Console

from hydraulic_sim.errors import ModelError, SimulationError
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import Settings
from hydraulic_sysid.diagnosis.search import DiagnosisError, add
from hydraulic_sysid.verbs import _cli as cli

from .compare import summary_json
from .diagnose import LONG, MODEL, add_diagnosis_options, check_target, show

EPILOG = """\
example:
  python -m hydraulic_sysid add valve_deadband --model sample_bench --record examples/sample_bench --out runs/added

exit codes: 0 held-out data bear the effect out; 1 they do not (the model is written all the same); 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = cli.parser("add", __doc__.partition("\n")[0], EPILOG)
    parser.add_argument("effect", metavar="EFFECT", help="name of an effect (hydraulic_sim effects lists them)")
    add_diagnosis_options(parser)
    return cli.run(parser, _add, argv, errors=(ModelError, SimulationError, DiagnosisError, results.ResultError))


def _add(options: argparse.Namespace) -> int:
    from .compare import read_window

    check_target(options, "add", (MODEL,))
    model = load_model(options.model)
    records = read_window(options)
    held_out = read_all(options.holdout, options.columns) if options.holdout else []
    with Console(stderr=True).status("fitting …") as status:
        done = add(
            model, options.effect, records, held_out, Settings(length=options.piece),
            lambda text: status.update(f"{text} …"),
        )  # fmt: skip
    results.write_result(options.out, done.result)
    save_model(done.model, options.out / MODEL)
    from hydraulic_sysid.report import write_page

    page = write_page(options.out, results.read_folder(options.out))
    if options.json:
        print(summary_json(done.result, LONG))
    else:
        show(done.result, Console(file=sys.stdout, highlight=False))
        print(f"\n{options.out / MODEL}\n{page}")
    return cli.OK if done.confirmed else cli.NEGATIVE


if __name__ == "__main__":
    sys.exit(main())
