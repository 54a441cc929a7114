"""Runs the diagnosis over the catalogue of hidden effects and gathers the confusion matrix.

One JSON document per bench, so that a run can be continued and parts of it be repeated.
"""

from __future__ import annotations

import hashlib
import json
import resource
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from . import benches, catalogue, scoring

ROOT = Path(__file__).resolve().parents[2]
FRESH = ("multisine", "steps", "fast")  # drawn anew: the same bench on another day
SOURCES = ("hydraulic_sim/hydraulic_sim", "hydraulic_sysid/hydraulic_sysid")


def version() -> str:
    """A digest of what is judged, so that results of different states are distinguished."""
    digest = hashlib.sha256()
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def examine(bench: benches.Bench, reference: bool = True) -> dict[str, Any]:
    """Make the bench, let it be diagnosed, and (``reference``) measure on records that the diagnosis never saw how
    far it came, beside the true structure."""
    from hydraulic_sim.model_file import load_model
    from hydraulic_sysid.data.records import read_all
    from hydraulic_sysid.data.results import plain
    from hydraulic_sysid.diagnosis.search import diagnose

    with tempfile.TemporaryDirectory() as scratch:
        place = benches.write(bench, Path(scratch))
        records = read_all(sorted(place.glob("*.csv.gz")))
        model = load_model(place / "model.yaml")
        again = benches.make(bench, draw=" fresh", names=FRESH) if reference else {}
        fresh = read_all(benches.write_records(again, Path(scratch) / "new")) if again else []
    answer = bench.answer()
    found: dict[str, Any] = {"version": version(), "answer": answer}
    begin, busy = time.perf_counter(), time.process_time()
    try:
        diagnosis = diagnose(model, records)
        found |= {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - busy}
        found["peak_MiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        found["result"] = plain(diagnosis.result)
        found["marks"] = scoring.judge(answer, found["result"])
        if reference and bench.kind in ("single", "pair"):
            ratio = held_out_ratio(bench, model, diagnosis.model, records, fresh)
            found["marks"] |= ratio
    except Exception:  # a diagnosis that breaks is a wrong one; the reason is kept
        found |= {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - busy}
        found["error"] = traceback.format_exc()
        broken = {"verdict": {"kind": "failed", "subsystem": None}, "effects": []}
        found["marks"] = scoring.judge(answer, broken)
    return found


def held_out_ratio(bench: benches.Bench, model: Any, after: Any, records: Any, fresh: Any) -> dict[str, float]:
    """Error on fresh records of the model before, after the diagnosis, and of the true structure refitted.

    The plant's dry friction has bristles, so `presliding` belongs to the true structure of every bench. Its fit
    begins at the true values.
    """
    from hydraulic_sysid.diagnosis.calibrate import calibrate
    from hydraulic_sysid.estimation.fit import evaluate

    true = model
    truth = bench.truth()
    for name in {*bench.effects, "presliding"}:
        true = true.with_effect(name, truth.get(name))
    best = calibrate(true, records, fresh).result["test"]["after"]
    reached = evaluate(after, fresh).rms
    before = calibrate(model, records, fresh).result["test"]["after"]
    return {
        "held_out_before": before,
        "held_out_after": reached,
        "held_out_true": best,
        "held_out_ratio": reached / best,
    }


def select(
    kind: str | None = None,
    severity: str | None = None,
    only: Iterable[str] = (),
    seeds: Iterable[int] = (),
) -> list[benches.Bench]:
    """Benches of the catalogue, narrowed down; ``only``: those that hide one of these effects; ``seeds``: further
    benches alike, of other seeds."""
    chosen = benches.every()
    more = [benches.Bench(b.kind, b.effects, b.severity, s) for b in chosen if b.kind != "none" for s in seeds]
    more += [benches.Bench("none", seed=1000 * s + b.seed) for b in chosen if b.kind == "none" for s in seeds]
    chosen = more or chosen
    names = set(only)
    strangers = names - set(catalogue.EVERY) - {"none"}
    if strangers:
        raise ValueError(f"unknown effects {sorted(strangers)}; known: {sorted(catalogue.EVERY)}")
    return [
        b
        for b in chosen
        if (kind is None or b.kind == kind)
        and (severity is None or b.severity in ("", severity))
        and (not names or names & {*(b.effects or ("none",))})
    ]


def run(
    chosen: list[benches.Bench], folder: Path, processes: int = 2, again: bool = False, reference: bool = True
) -> None:
    """Examine benches, in parallel, those not yet in ``folder`` (or all, ``again``); print each as it is done.

    The order is a shuffled one, so that a run that is ended early has seen a fair part of the catalogue.
    """
    folder.mkdir(parents=True, exist_ok=True)
    todo = [b for b in chosen if again or not (folder / f"{b.name}.json").exists()]
    todo.sort(key=lambda b: hashlib.sha256(b.name.encode()).digest())
    print(f"{len(chosen)} benches, {len(todo)} to do, {processes} processes", flush=True)
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        jobs = {pool.submit(examine, b, reference): b for b in todo}
        for done in as_completed(jobs):
            found = done.result()
            name = jobs[done].name
            part = folder / f"{name}.json.part"
            part.write_text(json.dumps(found, indent=1) + "\n")
            part.replace(folder / f"{name}.json")
            marks = found["marks"]
            said = ", ".join(marks["named"]) or marks["verdict"]
            print(f"{found['cpu_seconds']:6.1f} s  {name:55s} {marks['verdict']}: {said}", flush=True)


def gather(chosen: list[benches.Bench], folder: Path) -> list[dict[str, Any]]:
    """What was found for these benches, as far as it is there; judged anew from the kept results."""
    found = []
    for b in chosen:
        path = folder / f"{b.name}.json"
        if not path.exists():
            continue
        document = json.loads(path.read_text())
        if "result" in document:
            document["marks"] |= scoring.judge(b.answer(), document["result"])
        found.append(document)
    return found


def rate_rows(found: list[dict[str, Any]]) -> list[str]:
    """The figures as rows of a Markdown table, with Wilson's 95 % intervals."""
    rows = ["| figure | wanted | measured | 95 % interval |", "|---|---|---|---|"]
    for name, (hits, count) in scoring.rates([d["marks"] for d in found]).items():
        title, wanted = scoring.RATES[name]
        low, high = scoring.wilson(hits, count)
        value = f"{hits}/{count} = {100 * hits / count:.0f} %" if count else "–"
        rows.append(f"| {title} | {wanted} | {value} | {f'{100 * low:.0f}…{100 * high:.0f} %' if count else ''} |")
    return rows


def answered(marks: dict[str, Any]) -> str:
    """What a diagnosis said, in few words."""
    if marks["verdict"] == scoring.TIE:
        return "indistinguishable: " + ", ".join(marks["named"] or marks["shortlist"])
    return " + ".join(marks["named"]) or marks["verdict"]


def confusion_rows(found: list[dict[str, Any]]) -> list[str]:
    """True against said, one row per true answer; every cell of the matrix that is not empty."""
    rows = ["| true | benches | said |", "|---|---|---|"]
    said: dict[tuple[int, str], Counter[str]] = {}
    order = ["none", "single", "pair", "unknown"]
    for d in found:
        m = d["marks"]
        key = (order.index(m["kind"]), " + ".join(m["true"]) or "nothing")
        said.setdefault(key, Counter())[answered(m)] += 1
    for (kind, true), counter in sorted(said.items()):
        cells = "; ".join(f"{name} ×{n}" if n > 1 else name for name, n in counter.most_common())
        rows.append(f"| {true}{' (not in the library)' if kind == 3 else ''} | {sum(counter.values())} | {cells} |")
    return rows


def document(found: list[dict[str, Any]], command: str, catalogued: int) -> str:
    """The page docs/diagnosis-matrix.md; ``catalogued``: how many benches there are to examine."""
    seconds = sorted(d["cpu_seconds"] for d in found)
    peak = max(d.get("peak_MiB", 0.0) for d in found)
    lines = [
        "# Diagnosis on benches with hidden effects",
        "",
        "Every bench is a plant that shares nothing with this project's simulator (`benchmarks/hidden_effects/`):",
        "another solver, other laws for the same physics, noise, quantisation, and as-built values within 5 % of the",
        "data sheet. The diagnosis sees six records of 20 s and a model file without the hidden effects. Errors on",
        "held-out data are measured on records of the same bench that the diagnosis never saw. Made by",
        "",
        f"    {command}",
        "",
        f"{len(found)} of {catalogued} benches, in a shuffled order; a diagnosis took "
        f"{seconds[len(seconds) // 2]:.0f} s of processor time (median), "
        f"{seconds[-1]:.0f} s (longest), and at most {peak:.0f} MiB.",
        "",
        "## Figures",
        "",
        *rate_rows(found),
        "",
        "A parameter's error is relative to the distance of the true value from the value at which the effect",
        "vanishes. Laws differ between plant and library: the library's best fit need not be the plant's value.",
        "",
        "## Confusion matrix",
        "",
        *confusion_rows(found),
        "",
        "## Parameters",
        "",
        "| bench | parameter | true | found | error | interval covers |",
        "|---|---|---|---|---|---|",
    ]
    for d in found:
        for p in d["marks"].get("parameters", []):
            lines.append(
                f"| {d['marks']['bench']} | {p['key']} | {p['true']:.4g} | {p['value']:.4g} "
                f"| {100 * p['relative_error']:+.1f} % | {'yes' if p['covered'] else 'no'} |"
            )
    return "\n".join([*lines, ""])
