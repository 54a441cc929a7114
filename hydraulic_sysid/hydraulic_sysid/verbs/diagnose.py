"""Find out which physical effect a model lacks to explain its records.

Fits what the model calls free, tries every effect of the library that is off, and says what is missing, what these
data cannot tell apart, that nothing is missing, or what shape it has that no effect explains. What counts must lower
the error on data that no fit has seen. Writes diagnose.json and a page (report.html); with --apply also model.yaml,
the model that the verdict names, and nothing where it names none; for a verdict with several names each competing model
(competing_EFFECT.yaml).
"""

from __future__ import annotations

import argparse
from functools import partial

from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.diagnosis.calibrate import FitSettings
from hydraulic_sysid.diagnosis.search import diagnose
from hydraulic_sysid.verbs import _diagnosis_table
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid diagnose --model sample_bench --record examples/sample_bench --out runs/diagnosed
  python -m hydraulic_sysid diagnose --model my.yaml --record a.csv b.csv --holdout c.csv --apply --out runs/mine

exit codes: 0 nothing is missing, or what is missing or wrong was found and named; 1 something is left that was not
named (outside the library, or effects that these data cannot tell apart); 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("diagnose", __doc__, EPILOG)
    opt.add_diagnosis_options(parser)
    parser.add_argument("--apply", action="store_true", help=f"write the model that the verdict names ({opt.MODEL})")
    return opt.run(parser, _diagnose, _diagnosis_table.show, argv, bulky=("worst_segments",))


def _diagnose(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    opt.check_new(options.out, *((opt.MODEL,) if options.apply else ()), "competing_*.yaml")
    model = load_model(options.model)
    records = opt.read_records(options)
    validation = opt.read_kept_back(options.holdout, options)
    done = diagnose(model, records, validation, FitSettings(length=options.segment), say)
    kind = done.result["verdict"]["kind"]
    models = {f"competing_{name}.yaml": model for name, model in done.competing.items()}
    notes = []
    if options.apply and done.decided:
        models = {opt.MODEL: done.model} | models
    elif options.apply:
        instead = f" ({', '.join(models)} are what is possible)" if models else ""
        notes.append(
            f"no {opt.MODEL} was written: the verdict is {kind!r}, which says of no model that it is right{instead}"
        )
    return opt.Done(done.result, {name: partial(save_model, one) for name, one in models.items()}, done.decided, notes)
