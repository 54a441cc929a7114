"""A bench with nothing missing, recorded as benches are: what the diagnosis makes of each usual fault.

    ./bench shell -- python benchmarks/usual_faults.py [--only WORDS …] [--seed S …] [--processes N]

The plant is the independent one (hidden_effects/): a press axis in closed loop (and, in one row, a small fast
actuator), four records of 10 s at 1 kHz, and a model file with the physics complete. Every row gets one fault of the
sensors, the logger or the data sheet, or none; printed are what should be said, what `diagnose` says, and whether that
is right. Right is: the fault named where it is of a kind that can be named, else "complete"; an effect is never right.
In the rows on noise there is noise of one kind in the sensors and nothing else, and the residual must be 0.95 … 1.05 ×
it as well.
"""

from __future__ import annotations

import argparse
import multiprocessing
import re
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter

from hidden_effects import benches, sensors
from hidden_effects.settings import Setting

Tables = dict[str, dict[str, np.ndarray]]
COMPLETE, SHEET, RECORDING = "complete", "data sheet", "recording"
PRESSURES = ("pressure_a_Pa", "pressure_b_Pa")
POLE = 60.0  # Hz, of the slow transducers
DRIVE_NOISE = 0.02  # V
SPIKES = 5e-4  # share of the samples
NOISE = {"position_m": 2e-5, **dict.fromkeys(PRESSURES, 2e4)}  # m, Pa: rms, of the press axis
STEPS = {name: 25e6 / 2**12 for name in PRESSURES} | {"position_m": 0.5 / 2**12}  # Pa, m: of 12-bit converters
LEVEL = (0.95, 1.05)  # residual over noise of an exact model


@dataclass(frozen=True)
class Row:
    """``change``: what is done to the tables; ``kinds``: verdicts that are right; ``said``: of which one must be named
    (empty: none need be); ``level``: whether the residual must be that of an exact model; ``sheet``: data-sheet values
    of the model file over the true ones."""

    title: str
    change: Callable[[Tables, np.random.Generator], Tables] = lambda tables, _: tables
    kinds: tuple[str, ...] = (COMPLETE,)
    said: tuple[str, ...] = ()
    sensors: str = "white"
    geometry: str = "press"
    noise: bool = True
    level: bool = False
    sheet: dict[str, float] = field(default_factory=dict)


def each(change: Callable[[dict[str, np.ndarray], np.random.Generator], dict[str, np.ndarray]]) -> Any:
    """A change of one table as that of all."""
    return lambda tables, rng: {name: change(table, rng) for name, table in tables.items()}


def middle_of_a_step(table: dict[str, np.ndarray], _: np.random.Generator) -> dict[str, np.ndarray]:
    """The record from 20 ms after its fastest motion's begin."""
    speed = np.abs(np.gradient(table["position_m"][: len(table["time_s"]) // 3]))
    first = int(np.argmax(speed > 0.8 * speed.max()))
    return {name: values[first:] for name, values in table.items()}


def logged_every(n: int) -> Any:
    return each(lambda table, _: {name: values[::n] for name, values in table.items()})


def without_pressures(table: dict[str, np.ndarray], _: np.random.Generator) -> dict[str, np.ndarray]:
    return {name: values for name, values in table.items() if name not in PRESSURES}


def late(*names: str) -> Any:
    return each(lambda table, _: {n: sensors.late(v, 1) if n in names else v for n, v in table.items()})


def slow_transducers(table: dict[str, np.ndarray], _: np.random.Generator) -> dict[str, np.ndarray]:
    share = float(np.exp(-2.0 * np.pi * POLE / sensors.RATE))

    def low_pass(row: np.ndarray) -> np.ndarray:
        return lfilter([1.0 - share], [1.0, -share], row - row[0]) + row[0]

    return {n: low_pass(v) if n in PRESSURES else v for n, v in table.items()}


def spiky(table: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    found = {name: values.copy() for name, values in table.items()}
    for name, noise in NOISE.items():
        sensors.spiked(found[name], rng, SPIKES, 50.0 * noise)
    return found


def noisy_drive(table: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    noise = DRIVE_NOISE * rng.standard_normal(len(table["time_s"]))
    return table | {"command_V": table["command_V"] + noise}


def one_pressure(table: dict[str, np.ndarray], _: np.random.Generator) -> dict[str, np.ndarray]:
    return {name: values for name, values in table.items() if name != PRESSURES[1]}


def short(table: dict[str, np.ndarray], _: np.random.Generator) -> dict[str, np.ndarray]:
    return {name: values[1000:3000] for name, values in table.items()}


def noisy(kind: Callable[[np.random.Generator, int], np.ndarray]) -> Any:
    """Noise of a kind, n samples of unit variance, on every channel of every record."""

    def change(table: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
        return {n: v + NOISE[n] * kind(rng, len(v)) if n in NOISE else v for n, v in table.items()}

    return each(change)


def white(rng: np.random.Generator, samples: int) -> np.ndarray:
    return rng.standard_normal(samples)


def low_passed(order: int, corner: float) -> Callable[[np.random.Generator, int], np.ndarray]:
    def kind(rng: np.random.Generator, samples: int) -> np.ndarray:
        found = lfilter(*butter(order, corner, fs=sensors.RATE), white(rng, samples + sensors.SETTLE))[sensors.SETTLE :]
        return found / found.std()

    return kind


def hum(rms: float) -> Callable[[np.random.Generator, int], np.ndarray]:
    def kind(rng: np.random.Generator, samples: int) -> np.ndarray:
        phase = 2.0 * np.pi * (50.02 * np.arange(samples) / sensors.RATE + rng.random())
        return white(rng, samples) + np.sqrt(2.0) * rms * np.sin(phase)

    return kind


def outliers(rng: np.random.Generator, samples: int) -> np.ndarray:
    found = white(rng, samples)
    sensors.spiked(found, rng, 1e-3, 50.0)
    return found


def converted(table: dict[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Each channel with noise of a third of its converter's step, in steps."""
    noise = {n: STEPS[n] / 3.0 * white(rng, len(v)) for n, v in table.items() if n in STEPS}
    return {n: STEPS[n] * np.round((v + noise[n]) / STEPS[n]) if n in STEPS else v for n, v in table.items()}


def noise_alone(title: str, change: Any, **other: Any) -> Row:
    return Row(f"noise: {title}", change, noise=False, level=True, **other)


LATE_DRIVE = ("drive", "position")  # one clock against the other: which is late cannot be told
ROWS = (
    Row("filtered pressures, hum, 12-bit converters", sensors="real"),
    Row("white noise"),
    Row("no noise at all", noise=False),
    Row("the log begins in the middle of a step", each(middle_of_a_step)),
    Row("position only", each(without_pressures)),
    Row("250 Hz log of the 1 kHz loop", logged_every(4), kinds=(COMPLETE, RECORDING)),
    Row("supply pressure 1 % wrong", kinds=(SHEET,), said=("supply_pressure",), sheet={"supply_pressure": 1.01}),
    Row("a payload as heavy as the mass", kinds=(SHEET,), said=("moving_mass",), sheet={"moving_mass": 0.5}),
    Row("pressures 1 ms late", late(*PRESSURES), kinds=(RECORDING,), said=("pressures",)),
    Row("drive 1 ms late", late("command_V"), kinds=(RECORDING,), said=LATE_DRIVE),
    Row("one-pole transducers", each(slow_transducers), kinds=(RECORDING,), said=("pressures_low_pass",)),
    Row("0.05 % spikes", each(spiky), kinds=(COMPLETE, RECORDING), said=("spikes",)),
    Row("20 mV noise on the drive", each(noisy_drive), kinds=(COMPLETE, RECORDING)),
    Row("a small fast actuator", geometry="small"),
    Row("one pressure only", each(one_pressure)),
    Row("records of 2 s", each(short)),
    noise_alone("white", noisy(white)),
    *(noise_alone(f"low pass of order 2, {f:g} Hz", noisy(low_passed(2, f))) for f in (400.0, 200.0, 100.0)),
    noise_alone("low pass of order 4, 400 Hz", noisy(low_passed(4, 400.0))),
    *(noise_alone(f"hum of {rms:g} of the noise", noisy(hum(rms))) for rms in (0.5, 1.0, 3.0)),
    noise_alone("0.1 % outliers of 50 times the noise", noisy(outliers), kinds=(COMPLETE, RECORDING), said=("spikes",)),
    noise_alone("steps of 12 bits", each(converted)),
)


def wrong(text: str, factors: dict[str, float]) -> str:
    """A model file with these parameters and their bounds multiplied."""
    for key, factor in factors.items():
        line = next(one for one in text.splitlines() if one.startswith(f"  {key}:"))
        text = text.replace(line, _multiplied(line, factor))
    return text


def _multiplied(line: str, factor: float) -> str:
    return re.sub(r"[\d.]+(e[+-]?\d+)?(?= )", lambda number: f"{factor * float(number[0]):.6g}", line)


def run(task: tuple[int, int]) -> dict[str, Any]:
    """The row of this number (its changes are functions that no other process can be sent), diagnosed."""
    from hydraulic_sim.model_file import load_model
    from hydraulic_sysid.data.records import read_all
    from hydraulic_sysid.data.results import plain
    from hydraulic_sysid.diagnosis.search import diagnose

    number, seed = task
    row = ROWS[number]
    bench = benches.Bench("none", seed=seed, setting=Setting(row.geometry, row.sensors, "closed", "right"))
    tables = row.change(benches.make(bench, noise=row.noise), bench.rng(row.title))
    with tempfile.TemporaryDirectory() as scratch:
        records = read_all(benches.write_records(tables, Path(scratch), bench.setting.decimals))
        path = Path(scratch) / "model.yaml"
        path.write_text(wrong(benches.model_text(bench), row.sheet))
        model = load_model(path)
    begin = time.perf_counter()
    result = plain(diagnose(model, records).result)
    recording = result.get("recording", {})
    said = [d["key"] for d in result.get("data_sheet", ())] + [f["name"] for f in recording.get("faults", ())]
    said += ["spikes"] * bool(recording.get("spikes"))
    kind = result["verdict"]["kind"]
    level = [result["residual"]["after"][role] for role in ("fit", "validation")]
    right = kind in row.kinds and (not row.said or any(name in said for name in row.said))
    right &= not row.level or all(LEVEL[0] <= one <= LEVEL[1] for one in level)
    return {
        "title": row.title, "seed": seed, "kind": kind, "said": said, "right": right, "level": level,
        "effects": [e["name"] for e in result["effects"] if e["added"]],
        "seconds": time.perf_counter() - begin, "text": result["verdict"]["text"],
    }  # fmt: skip


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", default=[], metavar="WORDS", help="rows whose title has one of these")
    parser.add_argument("--seed", nargs="+", type=int, default=[1], metavar="S")
    parser.add_argument("--processes", type=int, default=2, metavar="N")
    options = parser.parse_args(argv)
    rows = [n for n, row in enumerate(ROWS) if not options.only or any(words in row.title for words in options.only)]
    tasks = [(row, seed) for row in rows for seed in options.seed]
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        found = []
        for one in pool.imap(run, tasks):
            found.append(one)
            mark = "right" if one["right"] else "WRONG"
            print(f"{mark}  {one['title']} (seed {one['seed']}, {one['seconds']:.0f} s, "
                  f"{one['level'][0]:.3f} and {one['level'][1]:.3f} × noise where fitted and validated)")
            print(f"       {one['text']}", flush=True)
    print(f"{sum(one['right'] for one in found)} of {len(found)} right")
    return 0


if __name__ == "__main__":
    sys.exit(main())
