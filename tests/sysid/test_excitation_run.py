"""Runs: the plan played on positions, the piston kept in its travel, and every reason to stop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_sysid.excitation import AppliedDriveCheck, ExcitationRun, Phase, Plan, load_plan, shipped_plans
from hydraulic_sysid.excitation.run import HOLD_S, STOP_RAMP_S
from hydraulic_sysid.excitation.signals.chirp import Chirp
from hydraulic_sysid.excitation.signals.steps import Steps
from hydraulic_sysid.excitation.signals.triangle import Triangle

SPEED_GAIN = 0.03  # m/s per volt, about that of the bench
STEP = 0.001


def plan(signal=None, **changes):
    options = {"travel_limit": 0.3, "centring_gain": 0.0, "rest_before": 0.1, "rest_after": 0.1}
    return Plan("any", signal or Triangle(2.0, 1.0), duration=2.0, **{**options, **changes})


def play(run, position=0.0, drift=0.0, until=math.inf, apply=lambda drive: drive):
    """Run an integrating plant; returns time, position and command of every step."""
    rows, k, applied = [], 0, 0.0
    while not run.done and k * STEP < until:
        drive = run.step(k * STEP, position, applied)
        rows.append((k * STEP, position, drive))
        applied = apply(drive)
        position += (SPEED_GAIN * (applied if math.isfinite(applied) else drive) + drift) * STEP
        k += 1
    return np.array(rows).T


def test_without_centring_the_plan_is_played_sample_by_sample():
    run = ExcitationRun(plan())
    _, _, drive = play(run)
    assert run.phase is Phase.FINISHED and run.reason == ""
    np.testing.assert_array_equal(drive[:-1], run.plan.open_loop)
    assert drive[-1] == 0.0 and run.played == run.plan.time.size


def test_a_lost_state_shortens_nothing():
    run = ExcitationRun(plan())
    drives = {k: run.step(5.0 + k * STEP, 0.0) for k in range(0, 2300) if k % 7 != 3}
    for k, drive in drives.items():
        assert drive == (run.plan.open_loop[k] if k < run.plan.time.size else 0.0)
    assert run.phase is Phase.FINISHED
    assert run.played == sum(1 for k in drives if k < run.plan.time.size) < run.plan.time.size


def test_a_slower_plant_gets_every_other_sample():
    run = ExcitationRun(plan())
    drive = [run.step(k * 0.002, 0.0) for k in range(1100)]
    np.testing.assert_array_equal(drive, run.plan.open_loop[::2])


def test_centring_stays_within_its_limit_and_fades_with_the_signal():
    run = ExcitationRun(plan(Steps([0.0], 1.0), centre=0.1, centring_gain=4.0, centring_limit=0.5))
    assert run.step(0.0, 0.0) == 0.0  # resting
    drive = [0.0] + [run.step(k * STEP, 0.15) for k in range(1, 1500)]
    assert drive[1000] == pytest.approx(-4.0 * 0.05)
    assert run.plan.rest_before == 0.1 and run.plan.fade_in == 0.5
    assert drive[350] == pytest.approx(-4.0 * 0.05 / 2)  # half of the fade
    assert run.step(1.5, -0.15) == 0.5
    assert run.step(1.501, 0.39) == -0.5


@pytest.mark.parametrize("name", shipped_plans())
@pytest.mark.parametrize("drift", [-0.006, 0.0, 0.006])
def test_shipped_plans_keep_an_integrating_plant_in_its_travel(name, drift):
    run = ExcitationRun(load_plan(name), applied_check=AppliedDriveCheck())
    _, position, _ = play(run, drift=drift)
    assert run.phase is Phase.FINISHED, run.reason
    assert np.abs(position).max() < 0.3


def test_it_is_centring_that_holds_the_piston():
    offset = dict(offset=0.4, travel_limit=10.0)
    signal = Chirp(1.0, 1.0, 5.0, 60.0)

    def last_position(gain):
        run = ExcitationRun(Plan("any", signal, centring_gain=gain, **offset))
        return play(run)[1][-1]

    assert last_position(0.0) > 0.6
    assert abs(last_position(4.0)) < 0.15


@settings(deadline=None)
@given(st.floats(-3, 3), st.floats(0, 1000), st.floats(0, 10), st.floats(1.1, 10))
def test_no_position_drives_beyond_the_limit(position, gain, authority, limit):
    chosen = plan(
        Triangle(1.0, 5.0),
        travel_limit=10.0,
        centring_gain=gain,
        centring_limit=authority,
        amplitude_limit=limit,
    )
    run = ExcitationRun(chosen)
    drive = [run.step(k * STEP, position) for k in range(500)]
    assert np.abs(drive).max() <= limit


@pytest.mark.parametrize(
    ("position", "words"),
    [
        (0.3001, "the piston is at 300.1 mm (allowed: -300.0 … 300.0 mm)"),
        (-0.31, "the piston is at -310.0 mm"),
        (math.nan, "the position is nan"),
        (math.inf, "the position is inf"),
    ],
)
def test_a_bad_position_aborts_at_once_and_for_good(position, words):
    run = ExcitationRun(plan(Steps([5.0], 1.0)))
    drive = [run.step(k * STEP, 0.0) for k in range(1000)]
    assert drive[-1] == 5.0
    assert run.step(1.0, position) == 0.0
    assert run.phase is Phase.ABORTED and words in run.reason and not run.done
    after = [run.step(1.0 + k * STEP, 0.0) for k in range(1, int(HOLD_S / STEP) + 2)]
    assert after == [0.0] * len(after)
    assert run.done and words in run.reason


def test_the_travel_guard_also_watches_a_piston_that_drifts_at_rest():
    run = ExcitationRun(plan(Steps([0.0], 1.0), rest_before=1.0))
    play(run, position=0.25, drift=0.1)
    assert run.phase is Phase.ABORTED and "the piston is at 300." in run.reason


@pytest.mark.parametrize(
    ("now", "words"),
    [
        (1.2, "no state for 0.701 s (allowed: 0.5 s)"),
        (0.4, "went from 0.499000 s to 0.400000 s"),
        (math.nan, "nan"),
    ],
)
def test_a_stale_state_or_a_broken_clock_aborts(now, words):
    run = ExcitationRun(plan())
    for k in range(500):
        run.step(k * STEP, 0.0)
    assert run.drive != 0.0
    assert run.step(now, 0.0) == 0.0
    assert run.phase is Phase.ABORTED and words in run.reason
    run.step(2.0, 0.0)
    assert run.done


def test_silence_is_found_by_the_clock_alone():
    run = ExcitationRun(plan())
    run.step(0.0, 0.0)
    run.check_age(0.499)
    assert run.phase is Phase.PLAYING
    run.check_age(0.501)
    assert run.phase is Phase.ABORTED and "no state for 0.501 s" in run.reason


def test_a_stop_ramps_down_and_then_holds_zero():
    run = ExcitationRun(plan(Steps([4.0], 1.0)))
    for k in range(1000):
        run.step(k * STEP, 0.0)
    run.stop("asked to")
    assert run.phase is Phase.STOPPING
    drive = [run.step((1000 + k) * STEP, 0.0) for k in range(300)]
    falling = drive[: int(STOP_RAMP_S / STEP) - 2]
    assert 3.8 < falling[0] < 4.0 and np.all(np.diff(falling) < 0)
    assert np.abs(np.diff(drive)).max() < 4.0 * 1.01 * STEP / STOP_RAMP_S
    assert drive[-1] == 0.0 and run.phase is Phase.ABORTED and run.reason == "asked to" and run.done


def test_a_finished_run_cannot_be_aborted():
    run = ExcitationRun(plan())
    play(run)
    run.abort("too late")
    run.stop("too late")
    assert run.phase is Phase.FINISHED and run.reason == ""


def late(delay):
    """A plant that applies each command `delay` steps late."""
    queue = [0.0] * delay

    def apply(drive):
        queue.append(drive)
        return queue.pop(0)

    return apply


def coarse():
    """An amplifier that takes a new value every fifth step only."""
    kept = [0.0, 0]

    def apply(drive):
        if kept[1] % 5 == 0:
            kept[0] = drive
        kept[1] += 1
        return kept[0]

    return apply


FAST, SLOW = Chirp(3.0, 40.0, 80.0, 2.0), Triangle(3.0, 0.5)


@pytest.mark.parametrize("signal", [FAST, SLOW, Steps([5.0, -5.0], 0.05)])
@pytest.mark.parametrize("apply", [late(0), late(5), late(30), coarse(), lambda u: u + 0.05])
def test_a_plant_that_follows_late_or_coarsely_is_accepted(signal, apply):
    run = ExcitationRun(plan(signal), applied_check=AppliedDriveCheck())
    play(run, apply=apply)
    assert run.phase is Phase.FINISHED, run.reason


@pytest.mark.parametrize("signal", [FAST, SLOW, Steps([5.0, -5.0], 0.05)])
@pytest.mark.parametrize(
    "apply",
    [
        lambda u: 0.0,
        lambda u: 2.0,
        lambda u: min(max(u, -0.5), 0.5),
        lambda u: 2.0 * u,
        lambda u: math.nan,
    ],
    ids=["zero", "constant", "clamped", "doubled", "nan"],
)
def test_a_plant_that_does_not_apply_the_command_ends_the_run(signal, apply):
    run = ExcitationRun(plan(signal), applied_check=AppliedDriveCheck())
    time, _, _ = play(run, apply=apply)
    assert run.phase is Phase.ABORTED and run.reason.startswith("the plant")
    assert time[-1] < 1.5


@pytest.mark.parametrize("signal", [FAST, SLOW, Steps([5.0, -5.0], 0.05)])
def test_a_moment_in_which_nothing_is_answered_is_forgiven(signal):
    """States that came while the process was held up are answered in a bundle; the plant held its drive."""
    run = ExcitationRun(plan(signal), applied_check=AppliedDriveCheck())
    calls, kept = [0], [0.0]

    def apply(drive):
        calls[0] += 1
        if not 700 <= calls[0] < 950:
            kept[0] = drive
        return kept[0]

    play(run, apply=apply)
    assert run.phase is Phase.FINISHED, run.reason


def test_a_reversed_drive_is_found_under_a_slow_signal():
    run = ExcitationRun(plan(SLOW), applied_check=AppliedDriveCheck())
    time, _, _ = play(run, apply=lambda drive: -drive)
    assert run.phase is Phase.ABORTED and run.reason.startswith("the plant applied")
    assert time[-1] < 1.5


def test_a_plant_that_stops_obeying_in_the_middle_is_found():
    run = ExcitationRun(plan(FAST), applied_check=AppliedDriveCheck())
    calls = [0]

    def apply(drive):
        calls[0] += 1
        return drive if calls[0] < 1000 else 0.0

    time, _, _ = play(run, apply=apply)
    assert run.phase is Phase.ABORTED and "applied 0.000 … 0.000 V" in run.reason
    assert 1.0 < time[-1] < 2.0
