"""Campaigns: what a second processor, a Dask cluster and being killed cost, and how far one scheduler goes.

    ./bench shell -- python benchmarks/campaign.py [--part speed|dask|kill|many|weak …]

speed: 160 comparisons on one process and on two. dask: the same on a LocalCluster of two processes. kill: a campaign of
40 cases killed at a random instant, ten times, and resumed. many: 10,000 trivial cases. weak: cases of half a second of
waiting, as if on machines of their own, 40 for each of 1, 2, 4 and 8 workers.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid import campaign

ROOT = Path(__file__).resolve().parents[1]
RECORDS = sorted((ROOT / "examples" / "sample_bench").glob("*.csv.gz"))


def trivial(number: int, place: Path) -> dict[str, Any]:
    return {"square": number**2}


def waiting(number: int, place: Path) -> dict[str, Any]:
    time.sleep(0.5)
    return {}


def noted(number: int, place: Path) -> dict[str, Any]:
    with (place.parents[1] / "begun").open("a") as log:
        log.write(f"{number}\n")
    time.sleep(random.uniform(0.0, 0.2))
    return {"square": number**2}


def numbered(count: int) -> list[campaign.Case]:
    return [campaign.Case(campaign.digest(i), {"number": str(i)}, i) for i in range(count)]


def comparisons() -> list[campaign.Case]:
    windows = {f"{a / 20:g} s": {"window": [a / 20, a / 20 + 4.0]} for a in range(54)}
    files = {r.name: [str(r)] for r in RECORDS}
    manifest = campaign.Manifest("compare", files, {"sample_bench": "sample_bench"}, windows)
    return campaign.verb_cases(manifest)[:160]


def timed(cases: list[campaign.Case], crew: campaign.Crew, work: Any, folder: Path) -> tuple[float, list[Any]]:
    begun = time.perf_counter()
    outcomes = campaign.run(work, cases, folder, crew)
    assert not any(o.failed for o in outcomes), next(o.error for o in outcomes if o.failed)
    return time.perf_counter() - begun, outcomes


def speed(scratch: Path, dask: bool) -> None:
    Plant(load_model("sample_bench"))
    cases = comparisons()
    two, found = timed(cases, campaign.processes(2), campaign.work, scratch / "two")
    if not dask:
        one, _ = timed(cases, campaign.processes(1), campaign.work, scratch / "one")
        print(f"{len(cases)} comparisons: one process {one:.1f} s, two {two:.1f} s: {one / two:.2f} × (wanted: 1.8)")
        return
    from distributed import LocalCluster

    begun = time.perf_counter()
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        up = time.perf_counter() - begun
        crew = campaign.dask_cluster(cluster.scheduler_address)
        there, same = timed(cases, crew, campaign.work, scratch / "dask")
    equal = [o.row for o in found] == [o.row for o in same]
    print(f"{len(cases)} comparisons: two processes {two:.1f} s, two Dask workers {there:.1f} s: {there / two:.3f} × ")
    print(f"  (wanted: within 0.15 of 1; the cluster's own start, {up:.1f} s, is not counted); rows bit-equal: {equal}")


def kill(scratch: Path, seed: int) -> None:
    rng = random.Random(seed)
    twice = missing = 0
    for turn in range(10):
        folder = scratch / f"kill-{turn}"
        folder.mkdir()
        command = [sys.executable, __file__, "--victim", str(folder)]
        process = subprocess.Popen(command, start_new_session=True)
        while not (folder / "begun").exists():
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 2.5))
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        time.sleep(1.0)
        done = {o.stem for o in folder.glob("cases/*.json")}
        before = Counter((folder / "begun").read_text().split())
        outcomes = campaign.run(noted, numbered(40), folder, campaign.processes(2))
        begun = Counter((folder / "begun").read_text().split())
        again = sum(begun[str(i)] > before[str(i)] for i, c in enumerate(numbered(40)) if c.key in done)
        missing += sum(o.row.get("square") != i**2 for i, o in enumerate(outcomes))
        twice += again
        print(f"  killed with {len(done)} of 40 done: {again} of these done again, {len(outcomes)} outcomes")
    print(f"killed 10 times: {twice} cases done twice, {missing} lost (wanted: none)")


def many(scratch: Path) -> None:
    begun = time.perf_counter()
    cases = numbered(10_000)
    seconds, _ = timed(cases, campaign.processes(2), trivial, scratch / "many")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    resumed, _ = timed(cases, campaign.processes(2), trivial, scratch / "many")
    print(f"10,000 trivial cases: {seconds:.1f} s = {1e3 * seconds / 1e4:.2f} ms each, planning included "
          f"{time.perf_counter() - begun - resumed:.1f} s; resumed with all done in {resumed:.1f} s; "
          f"scheduler's memory at most {peak:.0f} MiB (wanted: 2048)")  # fmt: skip


def weak(scratch: Path) -> None:
    first = 0.0
    for workers in (1, 2, 4, 8):
        crew = campaign.processes(workers)
        campaign.run(trivial, numbered(4 * workers), scratch / f"warm-{workers}", crew)
        seconds, _ = timed(numbered(40 * workers), crew, waiting, scratch / f"weak-{workers}")
        first = first or seconds
        print(f"weak scaling: {workers} workers, {40 * workers} cases of 0.5 s: {seconds:.1f} s, "
              f"efficiency {first / seconds:.2f}, start of the workers included")  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = ("speed", "dask", "kill", "many", "weak")
    parser.add_argument("--part", nargs="+", choices=parts, default=parts)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--victim", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.victim:
        campaign.run(noted, numbered(40), options.victim, campaign.processes(2))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        for part in options.part:
            place = scratch / part
            place.mkdir()
            if part in ("speed", "dask"):
                speed(place, part == "dask")
            elif part == "kill":
                kill(place, options.seed)
            else:
                {"many": many, "weak": weak}[part](place)
    return 0


if __name__ == "__main__":
    sys.exit(main())
