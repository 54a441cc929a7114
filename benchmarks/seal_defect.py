"""Six rotary actuators, one with a damaged seal: is it the one that is out of family?

    ./bench shell -- python benchmarks/seal_defect.py FOLDER [--out FOLDER]

FOLDER is `Data` of github:vtnsi/actuator_dataset (MIT licence), some 600 strokes of six hydraulic rotary actuators
under several loads; angle and both pressures as raw counts, no drive, no flow. What the raw counts allow: oil that a
moving actuator displaces leaves through the return port, whose orifice makes speed over the root of the return pressure
the same for all sound units of one size. Oil that leaves elsewhere, through a seal to the case, is lacking there and
raises the ratio, here called leakage index. It is taken for each stroke and direction, pooled for each unit, and given
to `fleet`.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

from hydraulic_sysid.monitoring.random_effects import pooled
from hydraulic_sysid.verbs import fleet

LEAST_STROKE = 1000  # counts
MOST_OF_STROKE = 0.97
BEGIN, MARGIN = 60, 15  # samples of acceleration, and before the end
_REPOSITORY = "github:vtnsi/actuator_dataset"


def stroke(file: Path) -> tuple[str, float] | None:
    """Direction, and speed over the root of the return pressure while it moves steadily; None for no whole stroke."""
    with file.open(encoding="latin-1", newline="") as stream:
        rows = list(csv.reader(stream, delimiter="\t"))
    columns = [rows[0].index(name) for name in ("Angle", "PG_1", "PG_2")]
    table = np.array([[float(row[c]) for c in columns] for row in rows[1:] if len(row) > max(columns) and row[0]])
    angle, first, second = table.T
    way = angle[-1] - angle[0]
    if abs(way) < LEAST_STROKE:
        return None
    end = int(np.argmax(np.abs(angle - angle[0]) > MOST_OF_STROKE * abs(way)))
    steady = slice(max(BEGIN, end // 3), end - MARGIN)
    speed = abs(np.polyfit(np.arange(steady.stop - steady.start), angle[steady], 1)[0])
    returned = (second if way > 0.0 else first)[steady].mean()
    return ("up" if way > 0.0 else "down"), float(speed / np.sqrt(returned))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    units = sorted(f for f in options.folder.iterdir() if f.is_dir())
    if not units:
        parser.error(f"{options.folder} holds no units; it is the folder Data of {_REPOSITORY}")
    out = options.out or Path(tempfile.mkdtemp())
    out.mkdir(parents=True, exist_ok=True)
    table = out / "estimates.csv"
    with table.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(("unit", "parameter", "measure", "value", "error"))
        for unit in units:
            strokes = [s for file in sorted(unit.glob("*.txt")) if (s := stroke(file))]
            for way in ("up", "down"):
                found = np.array([ratio for direction, ratio in strokes if direction == way])
                scatter = np.full(len(found), found.std(ddof=1))
                family = pooled(found, scatter)
                row = (unit.name, f"leakage index, {way}", "counts", family.mean, family.error)
                writer.writerow(row)
    return fleet.main([str(table), "--out", str(out)])


if __name__ == "__main__":
    sys.exit(main())
