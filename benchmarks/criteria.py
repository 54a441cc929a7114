"""What becomes of verdicts where a constant of the search is half or twice as large.

    ./bench shell -- python benchmarks/criteria.py [--seed S] [--count N] [--only NAME …] [--out FOLDER]

Benches are of the family that hides anything, and one of an unknown law (--what: all of one kind). Each is diagnosed
once with all constants watched: where no comparison comes out differently, half or double would change nothing at all.
For the others the quickest benches are diagnosed again. Printed are, per constant, in how many benches a decision would
be another, and those whose verdict is (kind, effects, numbers or faults), and whether that is right. Of a share above a
half what it lacks to 1 is halved or doubled, of a residual over noise what it has beyond 1. Diagnoses are quick ones
(--full: not). A run continues where it ended.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time
from dataclasses import fields
from pathlib import Path
from typing import Any

from hidden_effects import benches, family, scoring
from hidden_effects.watched_number import Label, WatchedNumber
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA, Criteria

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "runs" / "criteria"
WHICH = ("half", "double")
ONLY_SAID = ("shared", "law_error", "shape_error", "vague_value", "surest")
"""Constants of the errors that are stated: no verdict follows from them."""
EFFORT = tuple(f.name for f in fields(Criteria) if f.metadata["effort"])
"""Constants that say how much is done: they are varied on the first benches (``--effort``)."""
PROBABILITIES = ("odds", "distinct", "law", "most_power", "unknown_laws", "noise_missed")
"""Constants that become plain numbers only where probabilities are stated; what they decide is compared before."""


def half_and_double(name: str) -> dict[str, float]:
    """What a constant is made."""
    value = getattr(CRITERIA, name)
    if isinstance(value, int):
        return {"half": max(value // 2, 1), "double": 2 * value}
    if 0.5 <= value < 1.0:
        return {"half": 1.0 - 2.0 * (1.0 - value) if value > 0.5 else 0.25, "double": 1.0 - 0.5 * (1.0 - value)}
    if name in ("little", "small"):
        return {"half": 1.0 + 0.5 * (value - 1.0), "double": 1.0 + 2.0 * (value - 1.0)}
    return {"half": 0.5 * value, "double": 2.0 * value}


def run(task: tuple[str, Path, bool, Label | None]) -> dict[str, Any]:
    """One bench diagnosed with one constant changed, or with all of them watched; in a process of its own."""
    from hydraulic_sim.model_file import load_model
    from hydraulic_sysid.data.records import read_all
    from hydraulic_sysid.data.results import plain
    from hydraulic_sysid.diagnosis.search import diagnose

    name, place, quick, changed = task
    begin = time.perf_counter()
    noted, lost = set[Label](), set[Label]()
    if changed is not None:
        object.__setattr__(CRITERIA, changed[0], half_and_double(changed[0])[changed[1]])
    else:
        for field in fields(Criteria):
            value = getattr(CRITERIA, field.name)
            if isinstance(value, float) and field.name not in ONLY_SAID:  # else nothing can be watched, or need be
                others = {(field.name, which): one for which, one in half_and_double(field.name).items()}
                object.__setattr__(CRITERIA, field.name, WatchedNumber(value, others, noted, lost))

    records, model = read_all(sorted(place.glob("*.csv.gz"))), load_model(place / "model.yaml")
    result = plain(diagnose(model, records, quick=quick).result)
    marks = scoring.judge(json.loads((place / "answer.json").read_text()), result)
    said = " ".join([marks["verdict"], *sorted([*marks["named"], *marks["said"]])])
    took = time.perf_counter() - begin
    return {
        "bench": name, "said": said, "right": bool(marks["verdict_right"]), "seconds": took,
        "noted": sorted(noted), "lost": sorted(lost - noted),
    }  # fmt: skip


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--count", type=int, default=5, metavar="N", help="benches, and one of an unknown law")
    parser.add_argument("--what", choices=tuple(family.WHAT), help="what all of them hide instead of anything")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="constants")
    parser.add_argument("--again", type=int, default=6, metavar="N", help="benches, the quickest, diagnosed again")
    parser.add_argument("--effort", type=int, default=3, metavar="N", help="of these for numbers of tries")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--watched", action="store_true", help="only in how many benches any decision would be another")
    parser.add_argument("--processes", type=int, default=2, metavar="N")
    parser.add_argument("--out", type=Path, default=OUT, metavar="FOLDER")
    options = parser.parse_args(argv)
    chosen = family.draw(options.count, [options.seed], options.what)
    chosen += [] if options.what else family.draw(1, [options.seed], "unknown")
    places = {b.name: benches.write(b, options.out / "benches") for b in chosen}
    kept = options.out / "found.jsonl"
    known = {_key(one): one for one in map(json.loads, kept.read_text().splitlines())} if kept.exists() else {}

    def all_of(tasks: list[tuple[str, Label | None]]) -> dict[Any, dict[str, Any]]:
        missing = [task for task in tasks if task not in known]
        left = [(name, places[name], not options.full, changed) for name, changed in missing]
        with multiprocessing.get_context("spawn").Pool(options.processes, maxtasksperchild=1) as pool:
            for (name, _, _, changed), one in zip(left, pool.imap(run, left), strict=True):
                known[name, changed] = one | {"changed": changed}
                with kept.open("a") as file:
                    file.write(json.dumps(known[name, changed]) + "\n")
                print(name, *(changed or ("watched",)), "→", one["said"], flush=True)
        return {task: known[task] for task in tasks}

    watched = all_of([(name, None) for name in places])
    names = [f.name for f in fields(Criteria) if not options.only or f.name in options.only]
    if options.watched:
        for name in names:
            print(name, *(sum(_noted(one, name, which) for one in watched.values()) for which in WHICH))
        return 0
    quickest = sorted(places, key=lambda bench: watched[bench, None]["seconds"])[: options.again]
    some = quickest[: options.effort]
    again = [
        (bench, (name, which))
        for bench in quickest
        for name in names
        for which in WHICH
        if (name in EFFORT and bench in some and not _floating(name))
        or (_noted(watched[bench, None], name, which) and (bench in some or name not in EFFORT))
    ]
    print(f"{len(again)} of {2 * len(names) * len(places)} are diagnosed again", flush=True)
    done = all_of(again)
    right = sum(one["right"] for one in watched.values())
    print(f"\nas they are: {right} of {len(places)} right; diagnosed again: {', '.join(quickest)}")
    for name in names:
        for which, value in half_and_double(name).items():
            other = sum(_noted(one, name, which) for one in watched.values())
            others = [
                f"{bench}: {one['said']} ({'right' if one['right'] else 'wrong'})"
                for (bench, changed), one in done.items()
                if changed == (name, which) and one["said"] != watched[bench, None]["said"]
            ]
            print(f"{name} {value:g}: decisions in {other}; verdicts: {'; '.join(others) or 'none'}")
    return 0


def _noted(one: dict[str, Any], name: str, which: str) -> bool:
    """Whether a decision on this bench would be another, or may be."""
    lost = () if name in PROBABILITIES else one["lost"]
    return (name, which) in {tuple(label) for label in (*one["noted"], *lost)}


def _floating(name: str) -> bool:
    """Whether a constant is watched: a number of things that are tried is not."""
    return isinstance(getattr(CRITERIA, name), float)


def _key(one: dict[str, Any]) -> tuple[str, Label | None]:
    return one["bench"], tuple(one["changed"]) if one["changed"] else None


if __name__ == "__main__":
    sys.exit(main())
