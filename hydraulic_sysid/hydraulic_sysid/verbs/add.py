"""Add one effect to a model: fit it to records and see what it does to the error on validation data.

Writes add.json, a page (report.html) and the new model (model.yaml), whose history says what it was learned from.
"""

from __future__ import annotations

import argparse
from functools import partial

from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.diagnosis.calibrate import FitSettings
from hydraulic_sysid.diagnosis.search import add
from hydraulic_sysid.verbs import _diagnosis_table
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
example:
  python -m hydraulic_sysid add valve_deadband --model sample_bench --record examples/sample_bench --out runs/added

exit codes: 0 validation data bear the effect out; 1 they do not (the model is written all the same); 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("add", __doc__, EPILOG)
    parser.add_argument("effect", metavar="EFFECT", help="name of an effect (hydraulic_sim effects lists them)")
    opt.add_diagnosis_options(parser)
    return opt.run(parser, _add, _diagnosis_table.show, argv, bulky=("worst_segments",))


def _add(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    opt.check_new(options.out, opt.MODEL)
    model = load_model(options.model)
    records = opt.read_records(options)
    validation = opt.read_kept_back(options.holdout, options)
    done = add(model, options.effect, records, validation, FitSettings(length=options.segment), say)
    return opt.Done(done.result, {opt.MODEL: partial(save_model, done.model)}, done.confirmed)
