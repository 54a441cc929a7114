"""The diagnosis against benches with something hidden: confusion matrix and rates.

    ./bench shell -- python benchmarks/diagnosis_matrix.py --family [--count N] [--seed S …] [--what WHAT]
    ./bench shell -- python benchmarks/diagnosis_matrix.py [--only NAME …] [--kind KIND] [--severity mild|strong]

The first runs N benches (per seed) of the family: geometry, sensors, loop and data sheet at random, with nothing, an
effect, a wrong number or a fault of the recording hidden (--what none|effect|datum|recording: that alone; or
pair|triple|unknown, which are drawn only so). The second runs the sample benches. Figures that are published come from
seeds that nothing was chosen on.

Benches come from the independent plant in hidden_effects/. The run is a campaign: each bench's outcome is kept in the
folder --out, a run continues where it was ended, and --scheduler takes the workers of a Dask cluster (which must find
benchmarks/ on their PYTHONPATH). With --write FOLDER the benches themselves are written (records,
the user's model file, the answer), nothing is diagnosed, and one of them can be looked at alone:

    ./bench shell -- python benchmarks/diagnosis_matrix.py --family --count 20 --seed 7 --write F
    ./bench run hydraulic_sysid diagnose --model F/NAME/model.yaml --record F/NAME/*.csv.gz --out runs/one

With --doc the page docs/diagnosis-matrix.md is written from all outcomes in that folder that are of the present state
of the code: the family first, then the sample benches.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hidden_effects import benches, family, matrix
from hidden_effects.reliability_diagram import reliability_diagram
from hydraulic_sysid import campaign

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "diagnosis-matrix.md"
OUT = ROOT / "runs" / "diagnosis_matrix"


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", action="store_true", help="benches of the family instead of the sample benches")
    parser.add_argument("--count", type=int, default=100, metavar="N", help="benches of the family per seed")
    parser.add_argument("--what", choices=tuple(family.WHAT), help="what all of them hide")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="benches that hide one of these")
    parser.add_argument("--kind", choices=tuple(matrix.HIDDEN))
    parser.add_argument("--severity", choices=benches.SEVERITIES)
    parser.add_argument("--seed", nargs="+", type=int, default=[], metavar="S", help="benches alike, of other seeds")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--processes", type=int, metavar="N", help="default: one for each processor")
    where.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the outcomes")
    parser.add_argument("--no-reference", action="store_true", help="skip the refits of the true structures (faster)")
    parser.add_argument("--quick", action="store_true", help="as `diagnose --quick` answers")
    parser.add_argument("--report-only", action="store_true", help="examine nothing, report what is in the folder")
    parser.add_argument("--doc", action="store_true", help=f"write {PAGE.relative_to(ROOT)}")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the reliability diagram")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the benches instead of diagnosing them")
    options = parser.parse_args(argv)
    if options.quick and options.doc:
        parser.error("--doc: the page is of full diagnoses, not of --quick")
    if options.family:
        drawn = family.draw(options.count, options.seed or [1], options.what)
        chosen = matrix.narrowed(drawn, options.kind, options.severity, options.only)
    else:
        chosen = matrix.select(options.kind, options.severity, options.only, options.seed)
    if options.write:
        for bench in chosen:
            print(benches.write(bench, options.write))
        return 0
    if options.report_only:
        names = {b.name for b in chosen}
        found = [d for d in matrix.kept(options.out, options.quick) if d["answer"]["name"] in names]
    else:
        crew = campaign.dask_cluster(options.scheduler) if options.scheduler else campaign.processes(options.processes)
        reference = not (options.no_reference or options.family or options.quick)
        found = matrix.run(chosen, options.out, crew, reference, options.quick)
    if not found:
        print("nothing was examined yet")
        return 1
    by_setting = matrix.setting_rows(found) if options.family else []
    reliability = matrix.reliability_rows(found)
    print("\n".join([*matrix.rate_rows(found), "", *reliability, "", *by_setting, "", *matrix.confusion_rows(found)]))
    if options.picture:
        print(reliability_diagram([d["marks"] for d in found], options.picture))
    if options.doc:
        PAGE.write_text(matrix.document(matrix.kept(options.out)))
        print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
