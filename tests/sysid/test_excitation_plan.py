"""Plans: what they give, what they refuse, and the files they live in."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_sysid.excitation import (
    ExcitationError,
    Plan,
    PlanError,
    PlaybackError,
    load_plan,
    save_plan,
    shipped_plans,
)
from hydraulic_sysid.excitation.signals.chirp import Chirp
from hydraulic_sysid.excitation.signals.multisine import Multisine
from hydraulic_sysid.excitation.signals.steps import Steps
from hydraulic_sysid.excitation.signals.triangle import Triangle

SIGNALS = st.one_of(
    st.builds(Triangle, st.floats(0.1, 8.0), st.floats(0.05, 40.0)),
    st.builds(Chirp, st.floats(0.1, 8.0), st.floats(0.1, 40.0), st.floats(0.1, 40.0), st.floats(0.5, 5.0)),
    st.builds(
        Multisine,
        st.lists(st.floats(0.1, 40.0), min_size=1, max_size=3, unique=True),
        st.floats(0.1, 2.5),
        st.sampled_from(("zero", "schroeder", "random")),
        st.integers(0, 100),
    ),
    st.builds(Steps, st.lists(st.floats(-8, 8), min_size=1, max_size=5), st.floats(0.1, 1.0)),
)
PLANS = st.builds(
    Plan,
    name=st.just("any"),
    signal=SIGNALS,
    travel_limit=st.just(0.5),
    duration=st.floats(1.0, 5.0),
    rate=st.sampled_from((200.0, 500.0, 1000.0)),
    offset=st.floats(-2.0, 2.0),
    fade_in=st.floats(0.01, 0.5),
    fade_out=st.floats(0.01, 0.5),
    rest_before=st.floats(0.0, 0.5),
    rest_after=st.floats(0.05, 0.5),
)


def plan_mapping(**changes):
    signal = {"kind": "triangle", "amplitude": 1.0, "frequency": 0.5}
    return {"name": "any", "signal": signal, "travel_limit": 0.5, "duration": 4.0, **changes}


@settings(deadline=None)
@given(PLANS)
def test_the_drive_is_bounded_finite_and_zero_at_both_ends(plan):
    drive = plan.open_loop
    assert drive.shape == plan.time.shape == (round(plan.total_time * plan.rate),)
    assert np.isfinite(drive).all()
    assert np.abs(drive).max() <= plan.amplitude_limit
    resting = (plan.time < plan.rest_before - 1e-6) | (plan.time > plan.rest_before + plan.active_time + 1e-6)
    assert not drive[resting].any()
    assert drive[0] == drive[-1] == 0.0


@settings(deadline=None)
@given(PLANS)
def test_a_plan_survives_yaml_and_json(plan):
    twin = Plan.from_mapping(yaml.safe_load(yaml.safe_dump(plan.as_mapping())))
    assert twin == plan
    assert Plan.from_mapping(json.loads(json.dumps(plan.as_mapping(), allow_nan=False))) == plan
    np.testing.assert_array_equal(twin.open_loop, plan.open_loop)


def test_fades_are_raised_cosines_over_signal_and_offset():
    plan = Plan("any", Steps([2.0], 1.0), 0.5, duration=4.0, offset=1.0, fade_in=1.0, fade_out=2.0, rest_before=0.5)
    at = [500, 750, 1000, 1250, 1500, 2500, 3000, 3500, 4000]  # samples: 0.5 s … 4 s
    rising = [0.5 - 0.5 * np.cos(np.pi * t) for t in (0, 0.25, 0.5, 0.75, 1.0)]
    falling = [0.5 + 0.5 * np.cos(np.pi * t / 2) for t in (0, 0.5, 1.0, 1.5)]
    np.testing.assert_allclose(plan.open_loop[at], 3.0 * np.array(rising + falling), atol=1e-12)
    assert plan.open_loop[4499] > 0.0 and plan.open_loop[4500] == 0.0


def test_without_fades_the_signal_is_whole():
    signal = Steps([1.0, -2.0], 0.25)
    plan = Plan("any", signal, 0.5, fade_in=0.0, fade_out=0.0, rest_before=0.1, rest_after=0.1)
    assert plan.duration == 0.5  # the signal's own length
    expected = np.concatenate([np.zeros(100), np.full(250, 1.0), np.full(250, -2.0), np.zeros(100)])
    np.testing.assert_array_equal(plan.open_loop, expected)


@pytest.mark.parametrize("name", shipped_plans())
def test_shipped_plans_have_their_files_names_and_stay_within_the_drive(name):
    plan = load_plan(name)
    assert plan.name == name
    assert plan.rate == 1000.0 and plan.duration == (26.0 if name == "probe" else 20.0)
    assert 0.9 < np.abs(plan.open_loop).max() < 10.0
    assert plan.travel_limit < 1.524 / 2


def test_shipped_plans_cover_the_four_kinds_of_the_first_bench():
    assert {"chirp", "multisine", "triangle", "steps"} <= set(shipped_plans())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rate": "fast"}, ["rate = 'fast'", "from 1 up to 10000 Hz"]),
        ({"rate": 0.5}, ["rate = 0.5", "Hz"]),
        ({"fade_in": 3.0, "fade_out": 2.0}, ["fade_in + fade_out = 5.0", "up to 4 s"]),
        ({"travel_limit": -0.1}, ["travel_limit = -0.1", "above 0"]),
        ({"travel_limit": "3 V"}, ["travel_limit = '3 V'", " m"]),
        ({"amplitude_limit": 0.5}, ["amplitude_limit = 0.5", "at least 1 V"]),
        ({"amplitude_limit": 12}, ["amplitude_limit = 12", "up to 10 V"]),
        ({"offset": 9.5}, ["amplitude_limit = 10.0", "at least 10."]),
        ({"duration": None}, ["duration = None", "triangle has no length"]),
        ({"amplitude": 3}, ["amplitude = 3", "one of the keys name, signal, travel_limit"]),
        ({"signal": "chirp"}, ["signal = 'chirp'", "kind: chirp | multisine"]),
        ({"signal": {"kind": "noise"}}, ["signal: kind = 'noise'", "chirp | multisine"]),
        ({"signal": {"kind": "triangle", "amplitude": 1.0}}, ["signal: triangle: frequency", "missing"]),
        (
            {"signal": {"kind": "triangle", "amplitude": 1.0, "frequency": 700}},
            ["rate = 1000.0", "at least 1400 Hz"],
        ),
        ({"name": 7}, ["name = 7", "text"]),
    ],
)
def test_an_error_names_file_key_value_and_what_is_allowed(tmp_path, changes, words):
    file = tmp_path / "plan.yaml"
    file.write_text(yaml.safe_dump(plan_mapping(**changes)))
    with pytest.raises(PlanError) as raised:
        load_plan(file)
    for word in [f"{file}: ", *words]:
        assert word in str(raised.value)


@pytest.mark.parametrize("missing", ["name", "signal", "travel_limit"])
def test_a_missing_key_is_named(tmp_path, missing):
    mapping = plan_mapping()
    del mapping[missing]
    with pytest.raises(PlanError, match=f"{missing} = None"):
        Plan.from_mapping(mapping)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, ["No such file", "chirp, multisine, probe, steps, triangle"]),
        ("name: [", ["not a readable plan"]),
        ("- a\n- b\n", ["YAML mapping"]),
        ("", ["YAML mapping"]),
    ],
)
def test_a_file_that_is_no_plan_is_refused(tmp_path, content, words):
    file = tmp_path / "plan.yaml"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ExcitationError) as raised:
        load_plan(file)
    for word in [str(file), *words]:
        assert word in str(raised.value)


def test_a_playback_counts_its_path_from_the_plan(tmp_path):
    (tmp_path / "drives").mkdir()
    (tmp_path / "drives" / "ramp.csv").write_text("time_s,drive_V\n0,0\n1,1\n2,2\n")
    mapping = plan_mapping(signal={"kind": "playback", "file": "drives/ramp.csv"}, duration=3.0)
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(mapping))
    plan = load_plan(tmp_path / "plan.yaml")
    assert plan.open_loop.max() == pytest.approx(2.0)
    (tmp_path / "drives" / "ramp.csv").unlink()
    with pytest.raises(PlaybackError, match=r"ramp\.csv"):
        load_plan(tmp_path / "plan.yaml")


def test_a_bad_plan_is_one_line_on_the_command_line(tmp_path):
    with pytest.raises(HydraulicError):
        load_plan(tmp_path / "none.yaml")


@pytest.mark.parametrize("frequency", ["2 rad/s", "5 kg", "nan", "two", "1,000"])
def test_text_is_a_number_and_a_fitting_unit_or_refused(frequency):
    """An angular frequency is no frequency: it would be off by 2π."""
    with pytest.raises(PlanError, match="frequency_start"):
        Chirp(1.0, frequency, 2.0, 1.0)


def test_saving_gives_the_same_plan_and_overwrites_nothing_silently(tmp_path):
    plan, file = load_plan("chirp"), tmp_path / "plan.yaml"
    save_plan(plan, file)
    assert load_plan(file) == plan
    other = load_plan("steps")
    with pytest.raises(ExcitationError, match="exists"):
        save_plan(other, file)
    assert load_plan(file) == plan
    save_plan(other, file, overwrite=True)
    assert load_plan(file) == other
