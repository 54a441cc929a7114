"""How long a diagnosis takes, beside a former state of the project, on the same benches in the same run.

    ./bench shell -- python benchmarks/diagnosis_speed.py FOLDER … [--former REVISION] [--within SECONDS]

Every FOLDER holds records (*.csv, *.csv.gz) and, unless it is a bench of the preset sample_bench, the model.yaml that
they are diagnosed with; `benchmarks/diagnosis_matrix.py --write` makes such. Both states diagnose each of them as the
command line does, one after the other, compiled code and imports warm. Printed are seconds, their ratio, seconds per
second of record with a half and with all of the records, and what was said; run it on an otherwise idle machine.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hydraulic_sysid.data.records import read_all

ROOT = Path(__file__).resolve().parents[1]
FORMER = "65e2798"
PRESET = "sample_bench"


def environment(root: Path) -> dict[str, str]:
    """With the packages of one state of the project, and nothing of another."""
    packages = [*root.glob("hydraulic_*"), *(root / "ros_ws" / "src").iterdir()]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(str(p) for p in packages if p.is_dir())}


def said(root: Path, model: str, records: list[Path], within: float | None) -> tuple[float, str]:
    """Seconds of one diagnosis by the state in ``root``, and the first sentence of its verdict."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "hydraulic_sysid", "diagnose", "--model", model, "--out", out]
        command += ["--record", *map(str, records)]
        command += ["--within", str(within)] if within else []
        begun = time.perf_counter()
        done = subprocess.run(command, env=environment(root), cwd=root, capture_output=True, text=True)
        seconds = time.perf_counter() - begun
        found = sorted(Path(out).rglob("diagnose.json"))
        if not found:
            return seconds, f"exit code {done.returncode}: {done.stderr.strip().splitlines()[-1:]}"
        verdict = json.loads(found[0].read_text())["verdict"]
        return seconds, (verdict if isinstance(verdict, str) else verdict["text"]).split(". ")[0]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="+", type=Path)
    parser.add_argument("--former", default=FORMER, metavar="REVISION", help="of the project (default %(default)s)")
    parser.add_argument("--within", type=float, metavar="SECONDS", help="what the present state is given")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        former = Path(folder) / "former"
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "--detach", former, options.former], check=True)
        try:
            for root in (former, ROOT):  # compiles
                warm = "from hydraulic_sim.model_file import load_model; from hydraulic_sim.plant import Plant; "
                warm += f"Plant(load_model({PRESET!r}))"
                subprocess.run([sys.executable, "-c", warm], env=environment(root), check=True)
            for bench in options.folder:
                compared(bench.resolve(), former, options.within)
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", former], check=True)
    return 0


def compared(bench: Path, former: Path, within: float | None) -> None:
    """Print one bench's rows."""
    records = sorted(bench.glob("*.csv*"))
    own = bench / "model.yaml"
    model = str(own) if own.is_file() else PRESET
    lengths = [len(r["drive"]) * r.dt for r in read_all(records, None)]
    half = max(len(records) // 2, 1)
    now, verdict = said(ROOT, model, records, within)
    part, _ = said(ROOT, model, records[:half], within)
    then, former_verdict = said(former, model, records, None)
    print(f"{bench.name}: {now:.1f} s, formerly {then:.1f} s: {then / now:.1f} times as fast")
    per_second = part / sum(lengths[:half]), now / sum(lengths)
    print(f"  {per_second[0]:.2f} s per second of record on a half of them, {per_second[1]:.2f} s on all")
    print(f"  now:      {verdict}\n  formerly: {former_verdict}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
