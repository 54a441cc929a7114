"""Identify a linear model from records and try it on test data.

ARX by least squares or instrumental variables, a continuous-time transfer function by output error, or state space by
a subspace method, of a given order or of one that a criterion chooses; best fit in free run and one step ahead, mean
squared error, final prediction error and residual tests, on data that the fit has not seen. Writes identify.json, the
model itself (linear_model.json) and a page to look at (report.html) into a folder.
"""

from __future__ import annotations

import argparse
import math
from functools import partial
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sysid.data.display import number, shown
from hydraulic_sysid.linear import identification
from hydraulic_sysid.linear.models import (
    CRITERIA,
    OFFSETS,
    Arx,
    ArxOrder,
    StateSpace,
    Structure,
    TransferFunction,
    TransferFunctionOrder,
    write_linear_model,
)
from hydraulic_sysid.linear.models.model_file import check_place
from hydraulic_sysid.verbs import _options as opt

MODEL_FILE = "linear_model.json"
EPILOG = """\
examples:
  python -m hydraulic_sysid identify --record runs/bag --holdout 0.2 --out runs/bag-identified
  python -m hydraulic_sysid identify --record a.csv.gz --holdout-record b.csv.gz --order 3 3 1 --out runs/arx
  python -m hydraulic_sysid identify --record runs/bag --model tf --poles 3 --holdout 0.5 --out runs/tf
  python -m hydraulic_sysid identify --record runs/bag --order 5 5 3 --select bic --out runs/chosen
"""
MODELS = ("arx", "iv", "tf", "ss")


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("identify", __doc__, EPILOG)
    opt.add_record_options(parser)
    parser.add_argument(
        "--model",
        choices=MODELS,
        default="arx",
        help="arx (default), iv: ARX by instrumental variables, tf: continuous transfer function, ss: state space",
    )
    parser.add_argument(
        "--order", metavar=("NA", "NB", "NK"), type=int, nargs=3, default=(3, 3, 1), help="of arx, iv (default 3 3 1)"
    )
    parser.add_argument("--poles", metavar="N", type=int, default=3, help="of tf (default 3)")
    parser.add_argument("--zeros", metavar="N", type=int, default=0, help="of tf (default 0)")
    parser.add_argument("--integrator", action="store_true", help="tf: one of the poles is 0")
    parser.add_argument("--delay", metavar="SECONDS", type=float, default=0.0, help="tf: dead time (default 0)")
    parser.add_argument("--states", metavar="N", type=int, default=3, help="of ss (default 3)")
    parser.add_argument(
        "--select", choices=CRITERIA, help="choose the order up to the one given: by FPE, AIC, BIC or cross-validation"
    )
    parser.add_argument(
        "--sampling-time",
        metavar="SECONDS",
        type=float,
        help="of the model (default 0.05 or the records' own where that is longer; tf: the records' own)",
    )
    opt.add_part_options(parser, 0.2)
    parser.add_argument(
        "--offsets", choices=OFFSETS, default="estimate", help="constant offsets (default: estimate them)"
    )
    opt.add_channel_options(parser)
    return opt.run(parser, _identify, _show, argv, bulky=("traces",))


def _identify(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    check_place(options.out / MODEL_FILE)
    structure = _structure(options)
    records = opt.read_records(options)
    test_records = opt.read_kept_back(options.holdout_record, options) or None
    own = max(r.dt for r in [*records, *(test_records or [])])
    settings = identification.IdentificationSettings(
        structure=structure,
        sampling_time=options.sampling_time or (own if options.model == "tf" else max(0.05, own)),
        holdout=options.holdout,
        offsets=options.offsets,
        select=options.select,
        input=options.input,
        output=options.output,
    )
    result, model = identification.identify(records, test_records, settings)
    write = partial(write_linear_model, model=model, **identification.about(result))
    return opt.Done(result, {MODEL_FILE: write})


def _structure(options: argparse.Namespace) -> Structure:
    if options.model in ("arx", "iv"):
        return Arx(ArxOrder(*options.order), options.model == "iv")
    if options.model == "tf":
        return TransferFunction(TransferFunctionOrder(options.poles, options.zeros, options.integrator), options.delay)
    return StateSpace(options.states)


def _show(result: dict[str, Any], console: Console) -> None:
    own = result["settings"]["output"]["unit"]
    factor, unit = shown(own)
    columns = ("|record", "|data", ">samples", ">free run", ">one step", f">MSE, one step, {unit}²")
    table = tables.table("Best fit in free run and one step ahead", columns)
    for part, word in (("test", "test data"), ("fit", "fitted")):
        for r in result[part]["records"]:
            table.add_row(
                r["name"], word, str(r["samples"]), _fit(r["best_fit_free_run"]), _fit(r["best_fit_one_step"]),
                number(r["mse_one_step"] * factor**2),
            )  # fmt: skip
        table.add_section()
    console.print(table)
    console.print(result["verdict"]["text"])
    if result["orders"]:
        console.print(f"{result['settings']['criterion'].upper()} chose it among {len(result['orders'])} orders")
    console.print(
        f"final prediction error {number(result['test']['fpe'] * factor**2)} {unit}² (what is expected on fresh data)"
    )
    poles = ", ".join(_pole(p) for p in result["model"]["poles"])
    console.print(f"poles {poles}")


def _fit(value: float) -> str:
    """A best fit in percent; a dash where an unstable model has none."""
    return "–" if math.isnan(value) else f"{value:.2f} %".replace("-", "−")


def _pole(pole: dict[str, Any]) -> str:
    return f"{pole['real']:.4f}" + (f"{pole['imaginary']:+.4f}i" if pole["imaginary"] else "")
