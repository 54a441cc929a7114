"""What goes on by a clock of its own is fitted with its phase: what its frequency is off adds up over a record."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.fit import fit
from hydraulic_sysid.estimation.parameters import Parameters, clocked

DT, SECONDS = 1e-3, 10.0
TRUE = {"amplitude": 4e5, "frequency": 27.15, "phase": 1.0}
NOISE = {"position": 1e-5, "pressure_a": 2e4, "pressure_b": 2e4}  # m, Pa


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench")


def test_frequency_and_phase_of_a_ripple_are_found_together(model: Model) -> None:
    t, rng = DT * np.arange(round(SECONDS / DT)), np.random.default_rng(3)
    drive = 2.5 * np.sin(2.0 * np.pi * (0.3 + 0.15 * t) * t)
    run = Plant(model.with_effect("pump_ripple", TRUE)).simulate(drive, DT)
    channels = {c: np.asarray(getattr(run, c)) + rng.normal(0.0, s, t.size) for c, s in NOISE.items()}
    start = model.with_effect("pump_ripple", TRUE | {"frequency": 27.13, "phase": 1.6})
    keys = [f"pump_ripple.{name}" for name in TRUE]
    found = fit(start, [Record("ripple", t, DT, {"drive": drive, **channels})], keys).values
    assert found["pump_ripple.frequency"] == pytest.approx(27.15, abs=0.001)
    assert found["pump_ripple.phase"] == pytest.approx(1.0, abs=0.05)
    assert found["pump_ripple.amplitude"] == pytest.approx(4e5, rel=0.03)


def test_a_resonance_is_no_clock(model: Model) -> None:
    """It answers to the motion, within a segment."""
    both = model.with_effect("pump_ripple").with_effect("structural_flexibility").with_effect("spool_dynamics")
    keys = [k for k in both.movable_keys() if both.parameter(k).unit == "Hz"]
    parameters = Parameters.of(both, keys)
    assert len(keys) == 3 and [k for k in keys if clocked(both, k)] == ["pump_ripple.frequency"]
    assert [k for k, turning in zip(keys, parameters.turning, strict=True) if turning] == ["pump_ripple.frequency"]
