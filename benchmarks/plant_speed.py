"""Speed of the compiled plant, against a hand-written C plant and against SciPy's solvers, in one run.

    ./bench shell -- python benchmarks/plant_speed.py

Prints microseconds per Runge-Kutta step and ratios. The C plant (benchmarks/base_plant.c) is the same base physics
written by hand; it needs a C compiler and is left out where there is none.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from hydraulic_sim.batch import Job, simulate_batch
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

DT = 1e-3
SECONDS = 120


def chirp(seconds: float) -> np.ndarray:
    t = np.arange(int(seconds / DT)) * DT
    return 4.0 * np.sin(2.0 * np.pi * (0.2 + (8.0 - 0.2) / seconds / 2.0 * t) * t)


def best_of(function, repeats: int = 7) -> float:
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def steps_per_sample(plant: Plant) -> int:
    return int(np.ceil(DT / plant.longest_step * 0.999999))


def base_model():
    """Six states as the C plant has them: orifices, chambers, mass, viscous friction, leakage, spool."""
    model = load_model("moog_mcr_m_1002_bench")
    return model.without_effect("coulomb_friction")


def all_effects_model():
    model = load_model("moog_mcr_m_1002_bench")
    for effect in model.library.values():
        if not effect.always_on and effect.name not in model.effects:
            model = model.with_effect(effect.name)
    return model


def c_seconds(plant: Plant, drive: np.ndarray) -> tuple[float, float] | None:
    """Time of the C plant over the same drive, and its largest position difference relative to range."""
    if shutil.which("cc") is None:
        return None
    source = Path(__file__).with_name("base_plant.c")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "base_plant.so"
        subprocess.run(["cc", "-O3", "-march=native", "-shared", "-fPIC", "-o", target, source, "-lm"], check=True)
        run = ctypes.CDLL(str(target)).run
    names = (
        "moving_mass", "piston_area_a", "stroke", "dead_volume_a", "bulk_modulus", "supply_pressure", "tank_pressure",
        "valve_flow", "valve_drop", "valve_leakage", "orifice_transition", "viscous_friction.coefficient",
        "internal_leakage.coefficient", "spool_dynamics.frequency", "spool_dynamics.damping", "end_stop.stiffness",
        "end_stop.damping", "drive_limit",
    )  # fmt: skip
    values = np.array([plant.value(n) for n in names])
    out = np.empty((len(drive), 6))
    start = plant.initial_state().states
    first = np.array([*start[:4], 0.0, 0.0])

    def call() -> None:
        state = first.copy()
        pointer = ctypes.POINTER(ctypes.c_double)
        run(
            drive.ctypes.data_as(pointer), ctypes.c_long(len(drive)), ctypes.c_double(DT),
            ctypes.c_long(steps_per_sample(plant)), values.ctypes.data_as(pointer), state.ctypes.data_as(pointer),
            out.ctypes.data_as(pointer),
        )  # fmt: skip

    seconds = best_of(call)
    ours = plant.simulate(drive, DT, plant.initial_state()).true_position
    return seconds, float(np.max(np.abs(out[:, 0] - ours)) / np.ptp(ours))


def solver_seconds(plant: Plant, drive: np.ndarray, method: str, rtol: float) -> tuple[float, np.ndarray]:
    """solve_ivp on the same compiled right-hand side, restarted at each sample because the drive is held."""
    scale = np.array([s.scale for s in plant.layout.state_records.values()])
    state = plant.initial_state().states
    position = np.empty(len(drive))
    begin = time.perf_counter()
    for k, volts in enumerate(drive):
        position[k] = state[0]
        found = solve_ivp(
            lambda t, y, volts=volts: plant.derivative(y * scale, volts, t)[0] / scale,
            (0.0, DT), state / scale, method=method, rtol=rtol, atol=rtol * 1e-3,
        )  # fmt: skip
        state = found.y[:, -1] * scale
    return time.perf_counter() - begin, position


def main() -> None:
    drive = chirp(SECONDS)
    base, everything = Plant(base_model()), Plant(all_effects_model())
    full = Plant(load_model("moog_mcr_m_1002_bench"))
    print(f"drive: {SECONDS} s at {1 / DT:.0f} Hz; one core; best of 7")
    rows = (("base (six states)", base), ("with Coulomb friction", full), ("all effects on", everything))
    for label, plant in rows:
        seconds = best_of(lambda plant=plant: plant.simulate(drive, DT))
        each = seconds / len(drive) / steps_per_sample(plant) * 1e6
        print(f"{label:24s} {seconds * 1e3:8.1f} ms   {each:6.3f} us per RK4 step of {plant.longest_step * 1e3:.3f} ms")
    ours = best_of(lambda: base.simulate(drive, DT))
    c = c_seconds(base, drive)
    if c is None:
        print("C plant: no C compiler found")
    else:
        ratio = f"ratio {ours / c[0]:.2f} (positions differ by {c[1]:.1e})"
        print(f"C -O3 -march=native      {c[0] * 1e3:8.1f} ms   {ratio}")
    short = chirp(2.0)
    reference = solver_seconds(base, short, "Radau", 1e-10)[1]
    mine = base.simulate(short, DT, base.initial_state()).true_position
    own = float(np.max(np.abs(mine - reference)) / np.ptp(reference))
    quick = best_of(lambda: base.simulate(short, DT, base.initial_state()))
    for rtol in (1e-3, 1e-4, 1e-6):
        seconds, found = solver_seconds(base, short, "LSODA", rtol)
        error = float(np.max(np.abs(found - reference)) / np.ptp(reference))
        print(f"LSODA rtol {rtol:.0e}: error {error:.1e} (ours {own:.1e}); {seconds / quick:.0f} times our time")
    jobs = [Job(full, drive[:20000], DT)] * 16
    one, two = best_of(lambda: simulate_batch(jobs, 1), 3), best_of(lambda: simulate_batch(jobs), 3)
    print(
        f"batch of 16 x 20 s: one by one {one * 1e3:.0f} ms, all cores {two * 1e3:.0f} ms, {one / two:.2f} times faster"
    )


if __name__ == "__main__":
    main()
