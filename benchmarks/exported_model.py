"""An exported model beside the plant that it comes from: how equal, how fast, and valid or not.

    ./bench shell -- python benchmarks/exported_model.py --out runs/exported

120 s of multisine at 1 kHz, on the sample bench with and without dry friction. Speed: the FMU's three calls a sample
(set the drive, step, read the outputs) from Python, the same through FMPy's own simulation, and the plant itself.
"""

from __future__ import annotations

import argparse
import ctypes
import time
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from hydraulic_sim import base
from hydraulic_sim.exchange.fmu import write_fmu
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

RATE, SECONDS, LINES = 1000.0, 120.0, 40
DRY = ("coulomb_friction", "stribeck_friction")


def multisine(seed: int) -> np.ndarray:
    """Sines of random phase up to 20 Hz, 6 V together, falling with frequency: the piston stays off the stops."""
    t = np.arange(round(SECONDS * RATE)) / RATE
    rng = np.random.default_rng(seed)
    f = np.arange(1, LINES + 1) * 0.5
    u = (np.sin(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, LINES)) / np.sqrt(f)).sum(axis=1)
    return 6.0 * u / np.abs(u).max()


def by_calls(file: Path, folder: Path, drive: np.ndarray) -> tuple[np.ndarray, float]:
    """Outputs (N, n_outputs) at each sample, seen before the sample's drive acts, and seconds."""
    known = fmpy.read_model_description(file)
    fmpy.extract(file, unzipdir=folder)
    unit = FMU2Slave(
        guid=known.guid, unzipDirectory=str(folder), modelIdentifier=known.coSimulation.modelIdentifier,
        instanceName="plant",
    )  # fmt: skip
    unit.instantiate()
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.setReal([0], [float(drive[0])])
    unit.exitInitializationMode()
    n = len(base.OUTPUTS)
    found, row, held = np.empty((len(drive), n)), (ctypes.c_double * n)(), (ctypes.c_double * 1)()
    outputs, drives = (ctypes.c_uint * n)(*range(1, n + 1)), (ctypes.c_uint * 1)(0)
    write, step, read, dt = unit.fmi2SetReal, unit.fmi2DoStep, unit.fmi2GetReal, 1.0 / RATE
    begun = time.perf_counter()
    for k in range(len(drive)):
        held[0] = drive[k]
        write(unit.component, drives, 1, held)
        read(unit.component, outputs, n, row)
        found[k] = row
        step(unit.component, k * dt, dt, 0)
    seconds = time.perf_counter() - begun
    unit.terminate()
    unit.freeInstance()
    return found, seconds


def examine(model: Model, folder: Path, drive: np.ndarray) -> None:
    """Print one model's figures."""
    file = folder / f"{model.name}.fmu"
    write_fmu(model, file, RATE)
    plant = Plant(model)
    plant.simulate(drive[:10], 1.0 / RATE)
    begun = time.perf_counter()
    truth = plant.simulate(drive, 1.0 / RATE)
    own = time.perf_counter() - begun
    found, seconds = by_calls(file, folder / model.name, drive)
    travel = np.ptp(truth["position"])
    off = np.abs(found[:, 0] - truth["position"]).max() / travel
    every = max(
        np.abs(found[:, i] - truth[name]).max() / max(np.ptp(truth[name]), 1e-12) for i, name in enumerate(base.OUTPUTS)
    )
    signal = np.rec.fromarrays([np.arange(len(drive)) / RATE, drive], names="time,drive")
    begun = time.perf_counter()
    fmpy.simulate_fmu(
        str(file), stop_time=SECONDS, step_size=1.0 / RATE, output_interval=1.0 / RATE, input=signal,
        output=["position"],
    )  # fmt: skip
    through = time.perf_counter() - begun
    problems = validate_fmu(str(file))
    print(
        f"{model.name}: position off by {off:.2g} of its range ({travel * 1e3:.1f} mm), any output {every:.2g}; "
        f"real time ×{SECONDS / seconds:.0f} by calls, ×{SECONDS / through:.0f} through FMPy, ×{SECONDS / own:.0f} the "
        f"plant itself; validated: {problems or 'no problems'}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    drive = multisine(options.seed)
    whole = load_model("sample_bench")
    smooth = whole
    for effect in set(DRY) & set(whole.effects):
        smooth = smooth.without_effect(effect)
    examine(whole, options.out, drive)
    examine(replace(smooth, name="sample_bench_smooth"), options.out, drive)


if __name__ == "__main__":
    main()
