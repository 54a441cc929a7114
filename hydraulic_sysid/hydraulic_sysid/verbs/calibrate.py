"""Fit a model's free parameters to records, and say how well these determine them.

Every record is cut into short segments whose initial states are fitted too, so that the drift of an integrating
plant does not hide the rest. Writes calibrate.json, a page (report.html) and the calibrated model (model.yaml).

With --check nothing is fitted: what the records contradict in the model file, or cannot identify (check.json).
"""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from hydraulic_node_utils import tables
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid.data.results import verb_of
from hydraulic_sysid.diagnosis.calibrate import FitSettings, calibrate
from hydraulic_sysid.diagnosis.check import check, warnings
from hydraulic_sysid.verbs import _check_table
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid calibrate --model sample_bench --record examples/sample_bench --out runs/calibrated
  python -m hydraulic_sysid calibrate --model my.yaml --record a.csv b.csv --holdout-record c.csv --out runs/mine
  python -m hydraulic_sysid calibrate --check --model my.yaml --record a.csv b.csv --out runs/checked

exit codes: 0 the fit has converged, or nothing contradicts the model file; 1 it has not, or something does; 2 unusable
input
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("calibrate", __doc__, EPILOG)
    parser.add_argument("--check", action="store_true", help="fit nothing: check the model file against the records")
    opt.add_model_option(parser)
    opt.add_record_options(parser)
    parser.add_argument("--holdout-record", metavar="PATH", type=Path, nargs="+", help="records the fit never sees")
    parser.add_argument(
        "--free", metavar="KEY", nargs="+", help="parameters to fit (default: those the model calls free)"
    )
    opt.add_segment_option(parser)
    parser.add_argument("--robust", action="store_true", help="let outliers count less (soft L1)")
    return opt.run(parser, _work, _show, argv)


def _work(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    return _check(options, say) if options.check else _calibrate(options, say)


def _check(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    model = load_model(options.model)
    records = opt.read_records(options) + opt.read_kept_back(options.holdout_record, options)
    result = check(model, records, options.segment, options.free, say)
    return opt.Done(result, good=not warnings(result["findings"]))


def _calibrate(options: argparse.Namespace, say: opt.Say) -> opt.Done:
    opt.check_new(options.out, opt.MODEL)
    model = load_model(options.model)
    records = opt.read_records(options)
    test_records = opt.read_kept_back(options.holdout_record, options)
    settings = FitSettings(length=options.segment, robust=options.robust)
    done = calibrate(model, records, test_records, settings, options.free, lambda text: say(f"calibrating: {text}"))
    return opt.Done(done.result, {opt.MODEL: partial(save_model, done.model)}, done.result["converged"])


def _show(result: dict[str, Any], console: Console) -> None:
    _check_table.show(result, console) if verb_of(result) == "check" else _show_fit(result, console)


def _show_fit(result: dict[str, Any], console: Console) -> None:
    values = []
    for p in result["parameters"]:
        unit = "" if p["unit"] == "1" else f" {p['unit']}"
        note = ", at bound" if p["at_bound"] else ""
        error = f"{p['standard_error']:.2g}" if math.isfinite(p["standard_error"]) else "not identifiable"
        values.append((p["key"], f"{p['before']:.4g}", f"{p['value']:.4g} ± {error}{unit}{note}"))
    title = f"{result['model']['name']}: calibrated (± standard error)"
    console.print(tables.table(title, ("|parameter", ">|before", "|after"), values))
    fits = [
        (row["record"], part, row["channel"], f"{row['before']:.3g}", f"{row['after']:.3g}")
        for part in ("fit", "test")
        for row in (result[part] or {"records": []})["records"]
    ]
    console.print(tables.table("residual over noise", ("record", "", "channel", ">before", ">after"), fits))
    for direction in result["not_identifiable"]:
        parts = ", ".join(f"{k} {w:+.2f}" for k, w in direction["weights"].items())
        console.print(f"the data cannot identify the combination {parts}")
    console.print(result["verdict"]["text"])
