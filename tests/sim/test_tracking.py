"""What no sensor sees is led along a record, so that runs may begin anywhere in it."""

from __future__ import annotations

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

DT, SECONDS, AHEAD = 1e-3, 12.0, 400
SEEN = ("position", "velocity", "pressure_a", "pressure_b")


@pytest.fixture(scope="module")
def bench() -> Model:
    return load_model("sample_bench")


def slowly(plant: Plant) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """A slow sine of the drive, what the plant does, and starts all over it."""
    drive = 0.4 * np.sin(2.0 * np.pi * 0.1 * DT * np.arange(round(SECONDS / DT)))
    run = plant.simulate(drive, DT, plant.initial_state())
    return drive, {c: np.asarray(getattr(run, c)) for c in SEEN}, np.arange(500, len(drive) - AHEAD - 1, 500)


@pytest.mark.parametrize("effect", ["valve_hysteresis", "spool_dynamics", "spool_rate_limit"])
def test_runs_from_within_a_record_go_on_as_the_whole_did(bench: Model, effect: str) -> None:
    plant = Plant(bench.with_effect(effect))
    assert plant.has_inner_states
    drive, seen, starts = slowly(plant)
    states, memories = plant.track(drive, DT, starts, np.stack([seen[c] for c in SEEN], axis=-1))
    again = plant.predict(drive, DT, starts, AHEAD, states, memories)
    whole = np.stack([seen["position"][s : s + AHEAD + 1] for s in starts])
    moved = np.ptp(whole, axis=1).max()
    assert np.abs(again["position"] - whole).max() < 0.01 * moved


def test_what_forgets_soon_needs_no_leading(bench: Model) -> None:
    assert not Plant(bench).has_inner_states
    assert not Plant(bench.with_effect("command_delay")).has_inner_states
    assert not Plant(bench.with_effect("sensor_backlash")).has_inner_states
