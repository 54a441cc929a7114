"""The diagnosis against benches with hidden effects: confusion matrix and rates.

    ./bench shell -- python benchmarks/diagnosis_matrix.py [--only EFFECT …] [--kind KIND] [--severity mild|strong]

Benches come from the independent plant in hidden_effects/. Each bench's outcome is kept as one JSON document in
the folder, and a run continues where it was ended. With --doc the page docs/diagnosis-matrix.md is written; with
--write FOLDER the benches themselves (records, the user's model file, the answer), and nothing is diagnosed.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hidden_effects import benches, matrix

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "diagnosis-matrix.md"


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[], metavar="EFFECT", help="benches that hide one of these")
    parser.add_argument("--kind", choices=("none", "single", "pair", "unknown"))
    parser.add_argument("--severity", choices=benches.SEVERITIES)
    parser.add_argument("--seed", nargs="+", type=int, default=[], metavar="N", help="benches alike, of other seeds")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "diagnosis_matrix", help="folder of the outcomes")
    parser.add_argument("--again", action="store_true", help="examine benches again that were examined before")
    parser.add_argument("--no-reference", action="store_true", help="skip the refits of the true structures (faster)")
    parser.add_argument("--report-only", action="store_true", help="examine nothing, report what is in the folder")
    parser.add_argument("--doc", action="store_true", help=f"write {PAGE.relative_to(ROOT)}")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the benches instead of diagnosing them")
    options = parser.parse_args(argv)
    chosen = matrix.select(options.kind, options.severity, options.only, options.seed)
    if options.write:
        for bench in chosen:
            print(benches.write(bench, options.write))
        return 0
    if not options.report_only:
        matrix.run(chosen, options.out, options.processes, options.again, not options.no_reference)
    found = matrix.gather(chosen, options.out)
    if not found:
        print("nothing was examined yet")
        return 1
    stale = {d["version"] for d in found} - {matrix.version()}
    if stale:
        print(f"{sum(d['version'] in stale for d in found)} outcomes are of another state of the code (--again)")
    print("\n".join([*matrix.rate_rows(found), "", *matrix.confusion_rows(found)]))
    if options.doc:
        given = argv if argv is not None else sys.argv[1:]
        shown = " ".join(["python benchmarks/diagnosis_matrix.py", *(a for a in given if a != "--report-only")])
        PAGE.write_text(matrix.document(found, f"./bench shell -- {shown}", len(chosen)))
        print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
