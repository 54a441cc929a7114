"""Find out which physical effect a model lacks to explain its records.

Fits what the model calls free, tries every effect of the library that is off, and says what is missing, what these
data cannot tell apart, that nothing is missing, or what shape it has that no effect explains. What counts must lower
the error on data that no fit has seen. Writes diagnose.json and a page (report.html); with --apply also model.yaml,
the model that the verdict names, and nothing where it names none; for a verdict with several names each competing model
(competing_EFFECT.yaml). Where the cause lies outside the library, --propose writes what is left as an effect file.
"""

from __future__ import annotations

import argparse
import keyword
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hydraulic_node_utils import cli
from hydraulic_node_utils.whole_file import write_text
from hydraulic_sim.model_file import Model, load_model, save_model
from hydraulic_sysid.diagnosis.calibrate import FitSettings
from hydraulic_sysid.diagnosis.proposed_effect import propose
from hydraulic_sysid.diagnosis.search import diagnose
from hydraulic_sysid.diagnosis.search.holdout import QUICK_LEAST, QUICK_SECONDS, QUICK_VALUES
from hydraulic_sysid.verbs import _diagnosis_table
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid diagnose --model sample_bench --record examples/sample_bench --out runs/diagnosed
  python -m hydraulic_sysid diagnose --model my.yaml --record a.csv b.csv --holdout c.csv --apply --out runs/mine
  python -m hydraulic_sysid diagnose --model my.yaml --record a.csv b.csv --propose my_effect.py --out runs/mine

exit codes: 0 nothing is missing, or what is missing or wrong was found and named; 1 something is left that was not
named (outside the library, effects that these data cannot tell apart, or a search that was ended early); 2 unusable
input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("diagnose", __doc__, EPILOG)
    opt.add_diagnosis_options(parser)
    parser.add_argument("--apply", action="store_true", help=f"write the model that the verdict names ({opt.MODEL})")
    parser.add_argument(
        "--within",
        metavar="SECONDS",
        type=cli.positive,
        help="end the search after about so long; the answer is the best so far and says so (as after Ctrl-C)",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help=f"use about {QUICK_SECONDS:g} s ({QUICK_LEAST} to {QUICK_VALUES} values), spread over all records, and "
        "leave out what only confirms: an answer in seconds, which misses what is small",
    )
    parser.add_argument(
        "--propose",
        metavar="FILE.py",
        type=Path,
        help="where the cause lies outside the library: write what is left as an effect file, which add joins",
    )
    return opt.run(parser, _diagnose, _diagnosis_table.show, argv, bulky=("worst_segments",))


def _diagnose(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    opt.check_new(options.out, *((opt.MODEL,) if options.apply else ()), "competing_*.yaml")
    model = load_model(options.model)
    if options.propose:
        _check_name(options.propose, model)
    records = opt.read_records(options)
    validation, test = (opt.read_kept_back(paths, options) for paths in (options.validation, options.holdout))
    done = diagnose(
        model, records, validation, FitSettings(length=options.segment), say, options.within, opt.watch(options),
        options.quick, test,
    )  # fmt: skip
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
    result = done.result
    files: dict[str, Callable[[Path], object]] = {name: partial(save_model, one) for name, one in models.items()}
    if options.propose:
        file: Path = options.propose.absolute()
        effect = propose(done.remaining, file.stem, [r.name for r in records], say) if done.remaining else None
        if effect is None:
            why = (
                "no curve explains anything" if done.remaining else f"the verdict is {kind!r}, not outside the library"
            )
            notes.append(f"{file.name} was not written: {why}")
        else:
            files[str(file)] = partial(write_text, content=effect.text, overwrite=False)
            result = {**result, "proposed_effect": effect.row | {"file": str(file)}}
    return opt.Done(result, files, done.decided, notes)


def _check_name(file: Path, model: Model) -> None:
    """Find out before the work that an effect can be written there.

    :raises UsageError: it cannot.
    """
    if file.suffix != ".py" or not file.stem.isidentifier() or keyword.iskeyword(file.stem):
        raise cli.UsageError(
            f"--propose {file}: an effect is named after its file; allowed is NAME.py, NAME an identifier"
        )
    if file.stem in model.library:
        raise cli.UsageError(f"--propose {file}: the library has an effect {file.stem} already; choose another name")
    if file.exists():
        raise cli.UsageError(f"--propose {file}: it exists; an effect file is never overwritten")
