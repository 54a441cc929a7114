"""Monitoring of simulated wear: how soon an onset is found, what is named, and how often nothing is taken for it.

    ./bench shell -- python benchmarks/wear.py [--series N] [--seed S] [--out FOLDER]

Each series is 24 bags of 20 s of one actuator of the independent plant (hidden_effects/): the viscosity of the oil
differs by 3 % from bag to bag, drives and noise are new in each. In half of the series the leakage past the piston
grows from a bag on, by a share of the valve's rated flow at supply pressure; in the others nothing changes. The model
is calibrated on the first two bags of a series. A second part draws estimates alone, thousands of bags, for the rate of
false alarms.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hidden_effects import benches, plant
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sysid import campaign
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.diagnosis.calibrate import calibrate
from hydraulic_sysid.monitoring import document, estimates
from hydraulic_sysid.monitoring.change import chart

BAGS, SCATTER = 24, 0.03
RATES = (0.01, 0.02, 0.04)
"""Growth of the leakage from bag to bag at supply pressure, in parts of the valve's rated flow."""
KEY = "internal_leakage.coefficient"


def write_series(folder: Path, seed: int, onset: int | None, rate: float) -> dict[str, str]:
    """Bags of one actuator; name → path."""
    bench = benches.Bench("none", seed=seed)
    built = bench.values()
    rng = bench.rng("wear")
    found = {}
    for i in range(BAGS):
        worn = 0.0 if onset is None else rate * max(0, i - onset + 1) * built["valve_flow"] / built["supply"]
        scattered = built["viscous"] * (1.0 + SCATTER * rng.standard_normal())
        values = built | {"leakage": built["leakage"] + worn, "viscous": scattered}
        feed, gain = bench.setting.feed(("multisine", "steps")[i % 2], bench.rng(f"feed {i}"))
        start = (0.0, 0.0, *benches.balanced(bench.plain()))
        table, _ = plant.run(values, feed, bench.rng(f"noise {i}"), centring=gain, start=start)
        name = f"bag_{i:02d}"
        found[name] = str(benches.write_records({name: table}, folder)[0])
    return found


def followed(folder: Path, bags: dict[str, str], workers: int | None) -> dict[str, Any]:
    first = calibrate(load_model("sample_bench"), read_all(list(bags.values())[:2])).model
    model = folder / "model.yaml"
    save_model(first, model)
    names = estimates.watched(first)
    cases = estimates.bag_cases(model, bags, None, names)
    outcomes = campaign.run(estimates.estimate, cases, folder / "run", campaign.processes(workers))
    with_effects, _ = estimates.followed(first, names)
    return document.monitored(with_effects, outcomes, {}, 200.0, 5)


def false_alarms(rng: np.random.Generator, parameters: int = 8, series: int = 150, bags: int = 60) -> None:
    for between in (0.0, 1.0, 3.0):
        alarms = watched = 0
        for _ in range(series):
            errors = rng.uniform(0.5, 2.0, bags)
            first = bags
            for _ in range(parameters):
                values = rng.normal(0.0, np.hypot(errors, between))
                alarm = chart(values, errors, 200.0 * parameters, 5).alarm
                first = min(first, alarm.at + 1) if alarm else first
            alarms += first < bags
            watched += first
        print(f"estimates alone, {parameters} parameters, scatter between bags {between:g} × their error: "
              f"{alarms} alarms in {watched} bags, one in {watched / max(alarms, 1):.0f} (wanted: ≥ 200)")  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--series", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    scratch = options.out or Path(tempfile.mkdtemp())
    quiet_bags = quiet_alarms = found = near = named = worn = 0
    for i in range(options.series):
        onset = int(rng.integers(9, 17)) if i % 2 == 0 else None
        rate = RATES[(i // 2) % len(RATES)]
        folder = scratch / f"series_{i}"
        result = followed(folder, write_series(folder / "bags", 1000 * options.seed + i, onset, rate), options.workers)
        alarms = {r["key"]: r["alarm"] for r in result["parameters"] if r["alarm"]}
        said = ", ".join(f"{k} since {a['onset']} (found at {a['at']})" for k, a in alarms.items()) or "nothing"
        grows = f"leakage + {100 * rate:g} % of the rated flow a bag from bag_{onset or 0:02d} on"
        print(f"series {i}: {'nothing changes' if onset is None else grows}; said: {said}", flush=True)
        if onset is None:
            quiet_bags += BAGS
            quiet_alarms += bool(alarms)
        else:
            worn += 1
            alarm = alarms.get(KEY)
            found += alarm is not None and onset <= alarm["at_index"] <= onset + 3
            near += alarm is not None and abs(alarm["onset_index"] - onset) <= 3
            named += result["changed"][:1] == [KEY]
    print(f"wear: found within three bags {found}/{worn}, onset within three bags of the true one {near}/{worn}, "
          f"named first {named}/{worn}; no wear: {quiet_alarms} alarms in {quiet_bags} bags")  # fmt: skip
    false_alarms(rng)
    return 0


if __name__ == "__main__":
    sys.exit(main())
