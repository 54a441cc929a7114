"""Add one effect to a model: fit it to records and see what it does to the error on validation data.

The effect is one of the library, or a file of your own (as `diagnose --propose` writes them). Writes add.json, a page
(report.html) and the new model (model.yaml), whose history says what it was learned from; of an effect of your own also
a copy of its file, so that the model has it beside it.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hydraulic_sim.model_file import Model, load_model, save_model
from hydraulic_sysid.diagnosis.calibrate import FitSettings
from hydraulic_sysid.diagnosis.search import add
from hydraulic_sysid.verbs import _diagnosis_table
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid add valve_deadband --model sample_bench --record examples/sample_bench --out runs/added
  python -m hydraulic_sysid add load_with_kink.py --model my.yaml --record a.csv b.csv --out runs/added

exit codes: 0 validation data bear the effect out; 1 they do not (the model is written all the same); 2 unusable input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("add", __doc__, EPILOG)
    parser.add_argument(
        "effect",
        metavar="EFFECT",
        help="name of an effect (hydraulic_sim effects lists them), or an effect file, FILE.py",
    )
    opt.add_diagnosis_options(parser)
    return opt.run(parser, _add, _diagnosis_table.show, argv, bulky=("worst_segments",))


def _add(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    file = Path(options.effect).expanduser().resolve() if options.effect.endswith(".py") else None
    copied = file is not None and file.parent != options.out.resolve()
    opt.check_new(options.out, opt.MODEL, *([file.name] if file and copied else []))
    model = load_model(options.model)
    if file is not None:
        model = model.with_effect_file(file)
    records = opt.read_records(options)
    validation, test = (opt.read_kept_back(paths, options) for paths in (options.validation, options.holdout))
    effect = options.effect if file is None else file.stem
    done = add(model, effect, records, validation, FitSettings(length=options.segment), say, opt.watch(options), test)
    files: dict[str, Callable[[Path], object]] = {}
    if file is not None and copied:
        files[file.name] = partial(shutil.copyfile, file)
    files[opt.MODEL] = partial(_save, done.model, file)
    return opt.Done(done.result, files, done.confirmed)


def _save(model: Model, file: Path | None, target: Path) -> None:
    """The model, which names the copy of its effect file."""
    save_model(model if file is None else model.with_moved_file(file, target.with_name(file.name)), target)
