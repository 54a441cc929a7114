"""Clipped stretches and rests against a stop that the model lacks are set aside, and fast records are slowed down."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_sim.model import Entry, Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.slower import slower
from hydraulic_sysid.diagnosis.check import contradictions
from hydraulic_sysid.diagnosis.search.holdout import MOST_VALUES, split
from hydraulic_sysid.diagnosis.search.set_aside import SATURATED, STOP, set_aside
from hydraulic_sysid.estimation.saturation import at_end_of_range
from hydraulic_sysid.estimation.segments import cut

Array = np.ndarray

DT = 1e-3
NOISE = 2e-4  # m
STROKE = 0.4  # m, short: the piston gets to both stops


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("sample_bench").with_values({"stroke": STROKE})


@pytest.fixture(scope="module")
def true_position(model: Model) -> tuple[Array, Array]:
    """Drive and position from stop to stop and back, resting a second and more at each."""
    plant, drive = Plant(model), np.repeat([8.0, -8.0, 3.0, -4.0], [2500, 2500, 4000, 4000])
    return drive, np.asarray(plant.simulate(drive, DT, plant.initial_state(position=-0.1)).position)


def recorded(drive: Array, position: Array, low_pass: float = 0.0, end: float = np.inf, shift: float = 0.0) -> Record:
    """With noise, shifted, clipped, and then through a first-order low pass of a time constant [s]."""
    draw = np.random.default_rng(5)
    seen = np.minimum(position + shift + NOISE * draw.standard_normal(drive.size), end)
    if low_pass:
        fade = float(np.exp(-DT / low_pass))
        seen, _ = lfilter([1.0 - fade], [1.0, -fade], seen, zi=[fade * seen[0]])
    return Record.sampled("run", DT, {"drive": drive, "position": seen})


@pytest.mark.parametrize("low_pass", [0.0, 3e-3])
@pytest.mark.parametrize("before_stop", [0.01, 2.0 * NOISE])
def test_a_converter_at_its_end_is_found_with_and_without_a_low_pass(
    true_position: tuple[Array, Array], low_pass: float, before_stop: float
) -> None:
    drive, position = true_position
    end = 0.5 * STROKE - before_stop
    found = at_end_of_range(recorded(drive, position, low_pass, end)["position"])
    assert found[position > end + NOISE].mean() > (0.9 if low_pass else 0.99)  # a low pass is late
    assert not found[position < end - 0.02 * STROKE].any()


@pytest.mark.parametrize("step", [0.0, 1e-4, 1e-3])
@pytest.mark.parametrize("noise", [0.0, 2e-4])
def test_a_rest_at_the_largest_reading_is_no_clipping(
    true_position: tuple[Array, Array], step: float, noise: float
) -> None:
    seen = true_position[1] + noise * np.random.default_rng(6).standard_normal(true_position[1].size)
    seen = np.round(seen / step) * step if step else seen
    assert not at_end_of_range(seen).any()
    turning = np.sin(np.linspace(0.0, 20.0, seen.size)) + noise * np.random.default_rng(6).standard_normal(seen.size)
    assert not at_end_of_range(np.round(turning / step) * step if step else turning).any()


@pytest.mark.parametrize("end", [1.0, -1.0])
def test_noise_of_less_than_a_step_is_not_cut_off_at_a_level(end: float) -> None:
    """Rounded, it leans to the side on which the next level is."""
    draw = np.random.default_rng(7)
    rest = -0.25 + 0.3 * draw.standard_normal(4000)
    moving = np.linspace(-300.0, 0.0, 4000) + 0.3 * draw.standard_normal(4000)
    assert not at_end_of_range(np.round(end * np.concatenate((moving, rest)))).any()


def test_what_is_set_aside_is_in_no_segment(model: Model, true_position: tuple[Array, Array]) -> None:
    drive, position = true_position
    end = 0.5 * STROKE - 0.01
    record = recorded(drive, position, end=end)
    (mask,), aside = set_aside(model, [record], 0.5)
    assert [(a.channel, a.reason) for a in aside] == [("position", SATURATED)]
    assert aside[0].reading == pytest.approx(end) and aside[0].seconds == pytest.approx(mask.sum() * DT)
    (segments,) = cut([record], model.kind, 0.5, left_out=[mask])
    inside = segments.first[:, None] + np.arange(segments.samples)
    assert len(segments) > 3 and not mask[inside].any() and np.all(np.diff(segments.first) >= segments.samples - 1)
    assert any(f.kind == "clipped" for f in contradictions(model, [record]))


def test_a_rest_against_a_stop_counts_only_where_the_model_has_it(
    model: Model, true_position: tuple[Array, Array]
) -> None:
    right, shifted = (recorded(*true_position, shift=shift) for shift in (0.0, 0.01))
    assert set_aside(model, [right], 0.5)[1] == []
    assert not any(f.kind in ("stop", "travel", "zero") for f in contradictions(model, [right]))
    _, aside = set_aside(model, [shifted], 0.5)
    assert {a.reason for a in aside} == {STOP} and len(aside) == 2
    inward = recorded(true_position[0], 0.95 * true_position[1])
    (stop,) = (f for f in contradictions(model, [inward]) if f.kind == "stop")
    assert stop.severity == "doubtful" and abs(stop.measured or 0.0) == pytest.approx(0.95 * 0.5 * STROKE, rel=0.01)


def test_a_servo_that_sticks_short_of_its_command_rests_against_no_stop() -> None:
    """Its drive is where it is told to be: 70 mrad beyond where friction holds it, and 1.4 rad beyond a stop."""
    values = {"moving_mass": 0.1, "drive_force": 0.3, "drive_limit": 10.0, "stroke": 3.0}
    entries = {key: Entry(value) for key, value in values.items()}
    servo = Model("servo", entries, ("end_stop", "position_loop"), kind="mechanical")
    told = np.interp(np.arange(12_000) % 6000, [0, 1000, 3000, 4000], [0.35, 0.65, 0.65, 0.35])
    held = np.clip(0.9 * told, 0.33, 0.58) + NOISE * np.random.default_rng(7).standard_normal(told.size)
    stuck, against = (
        Record.sampled(name, DT, {"drive": command, "position": held})
        for name, command in (("stuck", told), ("against", 3.0 * told))
    )
    assert set_aside(servo, [stuck], 0.5)[1] == []
    assert STOP in {a.reason for a in set_aside(servo, [against], 0.5)[1]}


def test_small_motion_far_from_the_stops_is_no_rest(model: Model) -> None:
    time = DT * np.arange(8000)
    slow = Record.sampled("slow", DT, {"drive": -np.cos(time), "position": -1e-3 * np.sin(time)})
    assert set_aside(model, [slow], 0.5)[1] == []


def test_a_slower_record_has_the_same_motion_and_the_mean_drive() -> None:
    time = 1e-4 * np.arange(20_000)
    wave = np.sin(2.0 * np.pi * 3.0 * time)
    drive = np.where(time < 1.0003, 0.0, 2.0)
    fast = Record.sampled("fast", 1e-4, {"drive": drive, "position": wave})
    for factor in (7, 10):
        slow = slower(fast, factor)
        assert slow.dt == pytest.approx(factor * 1e-4) and len(slow) == 20_000 // factor
        assert np.abs(slow["position"] - np.sin(2.0 * np.pi * 3.0 * slow.time))[3:-3].max() < 2e-4
        assert slow["drive"].sum() * slow.dt == pytest.approx(drive[: len(slow) * factor].sum() * 1e-4)
    assert slower(fast, 1) is fast


def test_many_fast_records_are_slowed_and_thinned_evenly(model: Model) -> None:
    time = 1e-4 * np.arange(120_000)
    channels = {c: np.sin(time) for c in ("drive", "position", "pressure_a")}
    records = [Record.sampled(str(i), 1e-4, channels) for i in range(30)]
    parts = split(records, (), model, 0.5)
    assert {s.record.dt for s in parts.segments} == {1e-3}
    assert 0.4 * MOST_VALUES < sum(s.measured.size for s in parts.segments) < 1.1 * MOST_VALUES
    begins = [float(s.first[0] * s.record.dt) for s in parts.segments]
    assert max(begins) > 2.0  # not the beginning of every record
    assert all(f.any() for f in parts.fit) and all(len(s) for s in parts.segments)
