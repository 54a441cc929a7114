"""The diagnosis over the benches with hidden effects as a campaign, and its confusion matrix."""

from __future__ import annotations

import hashlib
import json
import resource
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hydraulic_sysid import campaign
from hydraulic_sysid.campaign.outcome import CASES

from . import benches, catalogue, family, scoring

ROOT = Path(__file__).resolve().parents[2]
REMARKS = {"unknown": " (not in the library)", "recording": " (recording)", "datum": " (data sheet)"}
HIDDEN = {"none": "nothing", "single": "an effect", "pair": "two effects", "triple": "three effects",
          "unknown": "an unknown effect", "datum": "a wrong number",
          "recording": "a fault of the recording"}  # fmt: skip
SHOWS = 1.03  # times the noise's mean square, from which what is left shows an effect
ROUNDING = "sensor_quantisation"  # whose size every record shows by itself, and by which nothing can be differentiated
SOURCES = ("hydraulic_sim/hydraulic_sim", "hydraulic_sysid/hydraulic_sysid")


def version() -> str:
    """A digest of what is judged, so that results of different states are distinguished."""
    digest = hashlib.sha256()
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def examine(bench: benches.Bench, reference: bool = True, quick: bool = False) -> dict[str, Any]:
    """Make the bench, let it be diagnosed, and (``reference``) measure on records that the diagnosis never saw how
    far it came, beside the true structure; ``quick``: as `diagnose` has it."""
    from hydraulic_sim.model_file import load_model
    from hydraulic_sysid.data.records import read_all
    from hydraulic_sysid.data.results import plain
    from hydraulic_sysid.diagnosis.search import diagnose

    with tempfile.TemporaryDirectory() as scratch:
        place = benches.write(bench, Path(scratch))
        records = read_all(sorted(place.glob("*.csv.gz")))
        model = load_model(place / "model.yaml")
        again = benches.make(bench, draw=" fresh", names=bench.setting.drawn) if reference else {}
        new = Path(scratch) / "new"
        fresh = read_all(benches.write_records(again, new, bench.setting.decimals)) if again else []
    answer = bench.answer()
    if bench.kind in scoring.TOGETHER:
        answer["visible"] = visible(bench, model, records)
    found: dict[str, Any] = {"version": version(), "answer": answer, "quick": quick}
    begin, busy = time.perf_counter(), time.process_time()
    try:
        diagnosis = diagnose(model, records, quick=quick)
        found |= {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - busy}
        found["peak_MiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        found["result"] = plain(diagnosis.result)
        found["marks"] = scoring.judge(answer, found["result"])
        if reference and bench.kind in ("single", *scoring.TOGETHER):
            ratio = held_out_ratio(bench, model, diagnosis.model, records, fresh)
            found["marks"] |= ratio
    except Exception:  # a diagnosis that breaks is a wrong one; the reason is kept
        found |= {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - busy}
        found["error"] = traceback.format_exc()
        broken = {"verdict": {"kind": "failed", "subsystem": None}, "effects": []}
        found["marks"] = scoring.judge(answer, broken)
    return found


def visible(bench: benches.Bench, model: Any, records: Any) -> list[str]:
    """Effects without which the true structure, fitted from the true values, leaves more than the noise hides."""
    from hydraulic_sysid.estimation.fit import fit

    true, built = model, bench.plain()
    for theirs, ours in benches.STATED.items():
        true = true.with_entry(theirs, value=built[ours])
    for name, values in bench.truth().items():
        true = true if name == ROUNDING else true.with_effect(name, values)

    def left(model: Any) -> float:
        return float(fit(model, records, model.free_keys()).cost)

    least = left(true)
    return [n for n in bench.effects if n == ROUNDING or left(true.without_effect(n)) > SHOWS * least]


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
    return narrowed(more or chosen, kind, severity, only)


def narrowed(
    chosen: Iterable[benches.Bench], kind: str | None = None, severity: str | None = None, only: Iterable[str] = ()
) -> list[benches.Bench]:
    """Those of one kind, of one severity, that hide one of ``only``.

    :raises ValueError: ``only`` names something that cannot be hidden.
    """
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
    chosen: list[benches.Bench],
    folder: Path,
    crew: campaign.Crew,
    reference: bool = True,
    quick: bool = False,
) -> list[dict[str, Any]]:
    """What is found for these benches, examined unless the folder has it of this state of the code; judged anew.

    The order is a shuffled one, so that a run that is ended early has seen a fair part of the catalogue.
    """
    now = version()
    cases = [
        campaign.Case(
            campaign.digest([b.name, now, reference, quick]), {"bench": b.name}, (b, reference, quick)
        )
        for b in chosen
    ]
    shuffled = sorted(cases, key=lambda case: case.key)
    outcomes = {o.key: o for o in campaign.run(examined, shuffled, folder, crew, _told)}
    lost = [o for o in outcomes.values() if o.failed]
    for outcome in lost:
        print(f"no outcome: {outcome.labels['bench']}: {outcome.error}")
    found = ((outcomes[case.key], b) for case, b in zip(cases, chosen, strict=True))
    return [_judged(dict(outcome.row), b.answer()) for outcome, b in found if not outcome.failed]


def examined(argument: tuple[benches.Bench, bool, bool], place: Path) -> dict[str, Any]:
    """The work of the campaign."""
    return examine(*argument)


def _told(progress: campaign.Progress) -> None:
    if progress.last is None:
        print(f"{progress.total} benches, {progress.total - progress.before} to do", flush=True)
    elif not progress.last.failed:
        found = progress.last.row
        right = "right" if _right(found) else "WRONG"
        said, name = answered(found["marks"]), progress.last.labels["bench"]
        print(f"{found['cpu_seconds']:6.1f} s  {right}  {name:70s} {said}", flush=True)


def kept(folder: Path, quick: bool = False) -> list[dict[str, Any]]:
    """All that was found in the present state of the code, by ``quick`` diagnoses or by full ones, judged anew."""
    outcomes = (json.loads(path.read_text()) for path in sorted((folder / CASES).glob("*.json")))
    found = [o["row"] for o in outcomes if o["state"] == "done"]
    now = version()
    return [_judged(d, d["answer"]) for d in found if (d["version"], d.get("quick")) == (now, quick)]


def _judged(document: dict[str, Any], answer: dict[str, Any]) -> dict[str, Any]:
    document["answer"] = {**document["answer"], **answer}  # it knows which of the effects show
    if "result" in document:
        document["marks"] |= scoring.judge(document["answer"], document["result"])
    return document


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
    beside = " + ".join(marks["said"]) if marks["verdict"] in (scoring.DATA_SHEET, scoring.RECORDING) else ""
    return " + ".join(marks["named"]) or (f"{marks['verdict']}: {beside}" if beside else marks["verdict"])


def confusion_rows(found: list[dict[str, Any]]) -> list[str]:
    """True against said, one row per true answer; every cell of the matrix that is not empty."""
    rows = ["| true | benches | said |", "|---|---|---|"]
    said: dict[tuple[int, str], Counter[str]] = {}
    order = list(scoring.RIGHT)
    for d in found:
        m = d["marks"]
        key = (order.index(m["kind"]), " + ".join(m["true"]) or "nothing")
        said.setdefault(key, Counter())[answered(m)] += 1
    for (kind, true), counter in sorted(said.items()):
        cells = "; ".join(f"{name} ×{n}" if n > 1 else name for name, n in counter.most_common())
        rows.append(f"| {true}{REMARKS.get(order[kind], '')} | {sum(counter.values())} | {cells} |")
    return rows


def setting_rows(found: list[dict[str, Any]]) -> list[str]:
    """How many diagnoses were right, by what surrounds the hidden thing and by what is hidden."""
    rows = ["| | benches | right | 95 % interval |", "|---|---|---|---|"]
    for factor in ("geometry", "sensors", "loop", "sheet"):
        rows += _level_rows(f"{factor}: {{}}", [(d["answer"]["setting"][factor], _right(d)) for d in found])
    return rows + _level_rows("hidden: {}", [(HIDDEN[d["marks"]["kind"]], _right(d)) for d in found])


def reliability_rows(found: list[dict[str, Any]]) -> list[str]:
    """How often verdicts are right, by the probability that they state."""
    rows = ["| said | on average | verdicts | right | 95 % interval |", "|---|---|---|---|---|"]
    for low, high, right, count, mean in scoring.reliability([d["marks"] for d in found]):
        rows.append(f"| {100 * low:.0f}…{100 * high:.0f} % | {100 * mean:.0f} % {_counted(right, count)}")
    return rows


def _level_rows(title: str, cases: list[tuple[str, bool]]) -> list[str]:
    rows = []
    for level in dict.fromkeys(sorted(level for level, _ in cases)):
        right = [hit for name, hit in cases if name == level]
        rows.append(f"| {title.format(level)} {_counted(sum(right), len(right))}")
    return rows


def _counted(right: int, count: int) -> str:
    """The cells of how many there are, how many of them are right, and the interval of that rate."""
    low, high = scoring.wilson(right, count)
    return f"| {count} | {right} = {100 * right / count:.0f} % | {100 * low:.0f}…{100 * high:.0f} % |"


def _right(found: dict[str, Any]) -> bool:
    marks = found["marks"]
    return bool(marks[scoring.RIGHT[marks["kind"]]])


def document(found: list[dict[str, Any]]) -> str:
    """The page docs/diagnosis-matrix.md: the family first, then the sample benches, whichever were examined."""
    drawn = [d for d in found if d["answer"]["setting"]["sized"]]
    samples = [d for d in found if not d["answer"]["setting"]["sized"]]
    lines = ["# Diagnosis on benches with hidden effects", "", *_METHOD, ""]
    if drawn:
        lines += ["## The family of benches", "", *_FAMILY, "", *_made(drawn, _options(drawn)), ""]
        lines += [*rate_rows(drawn), "", *_RELIABILITY, "", *reliability_rows(drawn), ""]
        lines += ["By setting:", "", *setting_rows(drawn), "", *confusion_rows(drawn), ""]
    if samples:
        lines += ["## The sample benches", "", *_SAMPLES, "", *_made(samples, ""), "", *rate_rows(samples), ""]
        lines += [*_PARAMETERS, "", *confusion_rows(samples), "", *parameter_rows(samples), ""]
    return "\n".join(lines)


def parameter_rows(found: list[dict[str, Any]]) -> list[str]:
    """True and found parameters of the effects that were rightly named."""
    rows = ["| bench | parameter | true | found | error | interval covers |", "|---|---|---|---|---|---|"]
    for d in found:
        for p in d["marks"].get("parameters", []):
            rows.append(
                f"| {d['marks']['bench']} | {p['key']} | {p['true']:.4g} | {p['value']:.4g} "
                f"| {100 * p['relative_error']:+.1f} % | {'yes' if p['covered'] else 'no'} |"
            )
    return rows


_METHOD = (
    "Every bench is a plant that shares nothing with this project's simulator (`benchmarks/hidden_effects/`): another",
    "solver, other laws for the same physics, noise, quantisation, and as-built values within 5 % of the data sheet.",
    "The diagnosis sees the records and a model file without what is hidden.",
)
_FAMILY = (
    "Geometry, sensors, loop and data sheet are drawn at random, and so is what is hidden: nothing, one effect, one",
    "wrong number of the data sheet, or a fault of the recording. Sizes are relative to the plant: forces to supply",
    "times area, flows to the open valve's, lengths to the stroke, times to the period of the oil's resonance. Where a",
    "data sheet is *off*, areas, dead volumes and supply pressure are wrong by up to 3 % each and carry no bounds. The",
    "seeds were used for nothing else.",
)
_RELIABILITY = ("How often verdicts are right, by the probability that they state (a tie: where it names the truth):",)
_SAMPLES = ("One actuator of 1.5 m, six records of 20 s, white noise.",)
_PARAMETERS = (
    "A parameter's error is relative to the distance of the true value from the value at which the effect",
    "vanishes. Laws differ between plant and library: the library's best fit need not be the plant's value.",
)


def _options(found: list[dict[str, Any]]) -> str:
    """The options that draw these benches."""
    members = [divmod(d["answer"]["seed"], family.APART) for d in found]
    seeds = " ".join(str(s) for s in sorted({seed for seed, _ in members}))
    return f" --family --count {max(number for _, number in members) + 1} --seed {seeds}"


def _made(found: list[dict[str, Any]], options: str) -> list[str]:
    seconds = sorted(d["cpu_seconds"] for d in found)
    peak = max(d.get("peak_MiB", 0.0) for d in found)
    return [
        f"    ./bench shell -- python benchmarks/diagnosis_matrix.py{options} --doc",
        "",
        f"{len(found)} benches; a diagnosis took {seconds[len(seconds) // 2]:.0f} s of processor time (median), "
        f"{seconds[-1]:.0f} s (longest), and at most {peak:.0f} MiB.",
    ]
