"""Long and fast records are diagnosed within a bounded memory."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record, save
from hydraulic_sysid.diagnosis.search import diagnosis

PEAK = """
import re, sys
from pathlib import Path
from hydraulic_sysid.diagnosis.search import candidate_fits
from hydraulic_sysid.verbs import diagnose
listed = candidate_fits.candidates
candidate_fits.candidates = lambda model: [effect for effect in listed(model) if effect.name != "backlash"]
code = diagnose.main(sys.argv[1:])
print(code, re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1])
"""
"""Exit code and the process's own peak [KiB]; `getrusage` would count its parent's, from before it was a process.

Without the backlash, whose stiff contact takes more than half of the time over half an hour. With it the peak was
831 MiB, without it 827 MiB.
"""


def record(rate: float, seconds: float) -> Record:
    rng = np.random.default_rng(9)
    t = np.arange(round(rate * seconds)) / rate
    drive = 2.0 * np.sin(2 * np.pi * 0.7 * t) + 1.5 * np.sin(2 * np.pi * 3.1 * t + 1.0) + np.sin(2 * np.pi * 9.3 * t)
    made = Plant(load_model("sample_bench")).simulate(drive, 1.0 / rate)
    channels = {"drive": made.drive, "position": made.position + 2e-5 * rng.standard_normal(t.size)}
    for name in ("pressure_a", "pressure_b"):
        channels[name] = made[name] + 1.5e4 * rng.standard_normal(t.size)
    return Record.sampled("long", 1.0 / rate, channels)


@pytest.mark.thorough
def test_half_an_hour_is_diagnosed_in_a_gibibyte(tmp_path: Path) -> None:
    path = save(record(1000.0, 1800.0), tmp_path / "long.parquet")
    command = [sys.executable, "-c", PEAK, "--model", "sample_bench", "--record", str(path), "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    code, peak = done.stdout.splitlines()[-1].split()
    assert code == "0", done.stderr
    assert "Complete" in done.stdout
    assert int(peak) <= 2**20  # KiB


def test_balances_are_formed_of_so_many_samples_and_no_more() -> None:
    fast = [Record.sampled(str(i), 1e-4, {"drive": np.zeros(300_000)}) for i in range(4)]
    assert sum(map(len, diagnosis.shortened(fast))) <= diagnosis.BALANCED_SAMPLES + 8
    slow = [Record.sampled("s", 0.004, {"drive": np.zeros(20_000)})]
    assert len(diagnosis.shortened(slow)[0]) == 10_000
