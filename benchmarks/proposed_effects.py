"""Effects that no library knows, proposed from records and joined to the model: how near that comes to the truth.

    ./bench shell -- python benchmarks/proposed_effects.py [--seed S …] [--only NAME …] [--severity mild|strong]

Each bench of the independent plant (hidden_effects/) hides one of the catalogue's laws that the library lacks. Its user
has the records and a model file without it. `diagnose` is asked to propose an effect, which joins the model and is
fitted (`add`, then `calibrate`). Errors are those on records of the same bench that nothing has seen: of the model as
it was, with the proposed effect, and of the true structure, each refitted by `calibrate`. The last is the same bench,
measured under the same noise, with nothing hidden. With --given the verdict "outside the library" is taken for granted:
the library is not searched.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from hidden_effects import benches, catalogue, scoring

AS_GOOD = 1.3


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", nargs="+", type=int, default=[1], metavar="S")
    parser.add_argument("--only", nargs="+", choices=tuple(catalogue.UNKNOWN), default=list(catalogue.UNKNOWN))
    parser.add_argument("--severity", choices=benches.SEVERITIES, nargs="+", default=list(benches.SEVERITIES))
    parser.add_argument(
        "--experiments", nargs="+", metavar="NAME", default=[], help="those of each bench that are used"
    )
    parser.add_argument("--given", action="store_true", help="do not search the library first")
    options = parser.parse_args(argv)
    rows = []
    for name in options.only:
        for severity in options.severity:
            for seed in options.seed:
                bench = benches.Bench("unknown", (name,), severity, seed)
                row = examined(bench, tuple(options.experiments), options.given)
                rows.append(row)
                print(line(bench.name, row), flush=True)
    proposed = [r for r in rows if r["ratio"] is not None]
    for title, cases in (("proposed", rows), ("of those proposed", proposed)):
        hits = sum(r["ratio"] is not None and r["ratio"] <= AS_GOOD for r in cases)
        low, high = (f"{100.0 * share:.0f}" for share in scoring.wilson(hits, len(cases)))
        print(f"{title}: error within {AS_GOOD} × the true structure's in {hits} of {len(cases)} ({low}…{high} %)")
    return 0


def line(name: str, row: dict[str, Any]) -> str:
    """One bench as a row of a table."""
    if row["ratio"] is None:
        return f"{name:42s} {row['said']}"
    return (
        f"{name:42s} {row['said']:50s} before {row['before']:6.3f}  added {row['added']:6.3f}  "
        f"refitted {row['refitted']:6.3f}  true {row['true']:6.3f}  ratio {row['ratio']:5.2f}  {row['seconds']:5.0f} s"
    )


def examined(bench: benches.Bench, names: tuple[str, ...], given: bool) -> dict[str, Any]:
    """What was proposed for one bench, and the errors on fresh records [residual over the noise of the sensors]."""
    from hydraulic_interfaces.errors import HydraulicError
    from hydraulic_sim.model_file import load_model
    from hydraulic_sysid.data.records import read_all
    from hydraulic_sysid.diagnosis.calibrate import calibrate
    from hydraulic_sysid.diagnosis.proposed_effect import propose
    from hydraulic_sysid.diagnosis.search import add, diagnose
    from hydraulic_sysid.diagnosis.search.diagnosis import Remaining
    from hydraulic_sysid.diagnosis.search.search import Search
    from hydraulic_sysid.estimation.fit import FitSettings, evaluate

    begin = time.process_time()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)

        def made(kind: str, without: tuple[str, ...] = (), draw: str = "") -> list[Any]:
            tables = benches.make(bench, without=without, draw=draw, names=names)
            return read_all(benches.write_records(tables, folder / kind, bench.setting.decimals))

        records, fresh = made("records"), made("fresh", draw=" fresh")
        text = folder / "model.yaml"
        text.write_text(benches.model_text(bench))
        model = load_model(text)
        if given:
            search = Search.of(model, records, (), FitSettings(), lambda _: None)
            base = search.begin()
            left, kind = Remaining.of(base.linearisation), "given"
        else:
            done = diagnose(model, records)
            left, kind = done.remaining, done.result["verdict"]["kind"]
        effect = propose(left, "own_effect", [r.name for r in records]) if left else None
        if effect is None:
            return {"said": kind, "ratio": None}
        what = f"{effect.place.removeprefix('unknown_')} over {effect.variable}: {effect.law} {effect.share:.2f}"
        file = folder / "own_effect.py"
        file.write_text(effect.text)
        for name in effect.beside:
            model = model.with_effect(name)
        before = calibrate(model, records, fresh).result["test"]["after"]
        hidden = bench.effects
        true = calibrate(load_model(text), made("plain", hidden), made("plain fresh", hidden, " fresh"))
        best = true.result["test"]["after"]
        try:
            if given:
                joined = search.state(base.model.with_effect_file(file).with_effect("own_effect")).model
            else:
                joined = add(model.with_effect_file(file), "own_effect", records).model
            added = evaluate(joined, fresh).rms
            refitted = calibrate(joined, records, fresh).result["test"]["after"]
        except HydraulicError as error:  # what was proposed does not run on all of the records
            return {"said": f"{what}: {error}", "ratio": None}
    seconds = time.process_time() - begin
    return {
        "said": what,
        "before": before,
        "added": added,
        "refitted": refitted,
        "true": best,
        "ratio": refitted / best,
        "seconds": seconds,
    }


if __name__ == "__main__":
    sys.exit(main())
