"""Reference trajectories: smooth where they say so, within their limits, refused beyond."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_control.errors import ControlError
from hydraulic_control.trajectories import KINDS, MotionLimits, approach, make

SETTINGS = {"offset": 0.01, "amplitude": 0.05, "frequency": 0.5, "cycles": 3, "levels": 4, "dwell": 1.0, "file": ""}
SMOOTH = sorted(set(KINDS) - {"step", "staircase", "playback"})


def sampled(trajectory, before: float = 0.01):  # type: ignore[no-untyped-def]
    time = np.arange(-before, trajectory.duration + 0.5, 1e-3)
    rows = np.array([trajectory.at(t) for t in time.tolist()])
    return time, rows[:, 0], rows[:, 1]


@pytest.mark.parametrize("kind", SMOOTH)
@settings(max_examples=12, deadline=None)
@given(
    amplitude=st.floats(-0.3, 0.3), frequency=st.floats(0.1, 1.0), velocity=st.floats(0.05, 1.0),
    acceleration=st.floats(0.5, 20.0),
)  # fmt: skip
def test_what_is_not_refused_is_smooth_and_within_the_limits(
    kind: str, amplitude: float, frequency: float, velocity: float, acceleration: float
) -> None:
    limits = MotionLimits(0.5, velocity, acceleration)
    try:
        trajectory = make(kind, {**SETTINGS, "amplitude": amplitude, "frequency": frequency}, limits)
    except ControlError:
        return
    if trajectory.duration > 100.0:
        return
    time, x, v = sampled(trajectory)
    assert np.abs(x).max() <= limits.travel
    assert np.abs(v).max() <= velocity * 1.001
    assert np.abs(np.diff(v)).max() <= acceleration * 1.1e-3
    assert x - x[0] == pytest.approx(np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1])) * 1e-3)), abs=1e-4)
    assert v[0] == v[-1] == 0.0, "begins and ends at rest"


def test_the_shapes() -> None:
    limits = MotionLimits(1.0, 0.4, 10.0)
    for kind, low, high in (
        ("step", 0.01, 0.06), ("staircase", 0.01, 0.06), ("sine", -0.04, 0.06), ("triangle", -0.04, 0.06),
        ("trapezoid", 0.01, 0.06), ("minimum_jerk", 0.01, 0.06),
    ):  # fmt: skip
        _, x, _ = sampled(make(kind, SETTINGS, limits))
        assert (x.min(), x.max()) == (pytest.approx(low, abs=1e-4), pytest.approx(high, abs=1e-4)), kind
    _, x, _ = sampled(make("staircase", SETTINGS, limits))
    assert len(np.unique(x.round(9))) == 5
    assert np.sum(np.diff(x) != 0.0) == 8
    _, _, v = sampled(make("triangle", SETTINGS, limits))
    speeds = np.abs(v[np.abs(v) > 0.99 * np.abs(v).max()])
    assert len(speeds) > 0.8 * len(v[v != 0.0]), "constant speed nearly all the way"
    _, _, v = sampled(make("trapezoid", {**SETTINGS, "amplitude": 0.5}, limits))
    assert v.max() == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("kind", "changed", "complaint"),
    [
        ("waltz", {}, "waltz"),
        ("step", {"amplitude": 0.7}, "position reaches 0.71 m; allowed are 0.5 m"),
        ("sine", {"frequency": 5.0}, "velocity reaches"),
        ("sine", {"frequency": 3.0, "amplitude": 0.02}, "velocity|acceleration"),
        ("triangle", {"frequency": 5.0}, "needs"),
        ("playback", {"file": "/no/such/file.csv"}, "cannot be read"),
    ],
)
def test_what_leaves_the_limits_is_refused(kind: str, changed: dict[str, float], complaint: str) -> None:
    with pytest.raises(ControlError, match=complaint):
        make(kind, {**SETTINGS, **changed}, MotionLimits(0.5, 0.3, 5.0))


def test_playback(tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text("time_s, position_m\n2.0, 0.00\n3.0, 0.05\n4.0, 0.02\n")
    trajectory = make("playback", {**SETTINGS, "file": str(file)}, MotionLimits(0.5, 0.4, 10.0))
    assert trajectory.duration == 2.0
    assert [trajectory.at(t)[0] for t in (-1.0, 0.0, 1.0, 2.0, 9.0)] == pytest.approx([0.0, 0.0, 0.05, 0.02, 0.02])
    _, x, v = sampled(trajectory)
    assert x.max() <= 0.05 + 1e-12
    assert v[0] == v[-1] == 0.0
    head = "time_s,position_m\n"
    for text in (head + "0,0\n", "t,x\n0,0\n1,1\n", head + "1,0\n0,1\n", head + "0,a\n1,0\n"):
        file.write_text(text)
        with pytest.raises(ControlError, match="needs"):
            make("playback", {**SETTINGS, "file": str(file)}, MotionLimits())


def test_the_approach_begins_where_the_piston_is() -> None:
    limits = MotionLimits(0.5, 0.2, 2.0)
    whole = approach(-0.3, make("step", SETTINGS, limits), limits)
    _, x, v = sampled(whole)
    assert x[0] == -0.3
    jumps = np.flatnonzero(np.abs(np.diff(x)) > 1e-3)
    assert len(jumps) == 1 and x[jumps[0]] == pytest.approx(0.01), "only the step itself jumps"
    assert np.abs(v).max() <= 0.2 * 1.001
    assert math.isclose(x[-1], 0.06)
