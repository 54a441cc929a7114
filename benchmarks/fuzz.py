"""Random and hostile messages, frames, parameters and files against the bench: nothing may move that must not.

    python benchmarks/fuzz.py [--count 1000000] [--seed 2026] [--target NAME …] [--batch N]

Counted are messages, frames, values and files. Every batch has a seed of its own, that of the run, its target's name
and its number; a finding is printed with them and can be repeated: ``--target NAME --seed S --batch N``. With
``HYDRAULIC_FUZZ_DOCUMENTS=DIR`` the result documents of a folder are damaged, too. Exit code 1 for any finding.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
from pathlib import Path

from abuse import Target, files, graph, pages, run_batch, streams, wire

TARGETS: dict[str, tuple[Target, float]] = {
    "commands": (streams.commands, 0.5),
    "references": (streams.references, 0.15),
    "parameters": (streams.parameters, 0.15),
    "frames": (wire.frames, 0.18),
    "csv files": (files.csv_files, 0.01),
    "column maps": (files.column_maps, 0.002),
    "gains": (files.gains, 0.002),
    "plans": (files.plans, 0.001),
    "bus files": (files.bus_files, 0.001),
    "model files": (files.model_files, 0.002),
    "bags": (files.bags, 0.001),
    "reports": (pages.reports, 0.001),
    "graph": (graph.graph, 0.02),
}
"""Target and its share of the count; `graph` is running nodes, one start for a batch."""


def fuzz(name: str, count: float, seed: int, only: int | None = None) -> tuple[int, list[str]]:
    """Run a target until it has sent so much; how much it was, and what was found."""
    target, sent, batch, findings = TARGETS[name][0], 0, only or 0, []
    with tempfile.TemporaryDirectory() as folder:
        while sent < count and len(findings) < 10:
            try:
                sent += run_batch(target, name, seed, batch, Path(folder))
            except Exception as error:
                where = "".join(traceback.format_exception(error)[-4:])
                findings.append(f"--target {name!r} --seed {seed} --batch {batch}: {where}")
            batch += 1
            if only is not None:
                break
    return sent, findings


def main() -> int:
    """Run and print; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1_000_000, help="of all targets together (default 1,000,000)")
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--target", nargs="+", choices=list(TARGETS), default=list(TARGETS))
    parser.add_argument("--batch", type=int, help="this one only")
    options = parser.parse_args()
    total, found = 0, 0
    share = sum(TARGETS[name][1] for name in options.target)
    print(f"seed {options.seed}\n{'target':<14} {'sent':>10} {'findings':>9} {'s':>7}")
    for name in options.target:
        began = time.perf_counter()
        sent, findings = fuzz(name, options.count * TARGETS[name][1] / share, options.seed, options.batch)
        print(f"{name:<14} {sent:>10,} {len(findings):>9} {time.perf_counter() - began:>7.1f}", flush=True)
        for finding in findings:
            print(f"  {finding}", flush=True)
        total, found = total + sent, found + len(findings)
    print(f"{'all':<14} {total:>10,} {found:>9}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
