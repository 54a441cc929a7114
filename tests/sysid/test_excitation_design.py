"""Designs: bands from the bandwidth, amplitudes within the limits, predictions that come true."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hydraulic_node_utils.cli import run_verb
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.excitation import ExcitationError, ExcitationRun, Phase, Plan, load_plan
from hydraulic_sysid.excitation.amplitude import Limits, largest
from hydraulic_sysid.excitation.design import SIGNALS, Wish, propose
from hydraulic_sysid.excitation.signals.sine import Sine
from hydraulic_sysid.excitation.simulated_run import Sensors, simulate_plan

BENCH = "moog_mcr_m_1002_bench"
WISH = Wish(0.5, 10.0, duration=9.0)


@pytest.fixture(scope="module")
def model():  # noqa: ANN201
    return load_model(BENCH)


@pytest.mark.parametrize("name", sorted(SIGNALS))
def test_a_design_plays_in_its_band(name: str) -> None:
    plan = propose(name, WISH)
    active = plan.open_loop[plan.envelope > 0.0]
    assert 0.05 < np.abs(active).max() < 5.0
    power = np.abs(np.fft.rfft(active * np.hanning(active.size))) ** 2
    frequency = np.fft.rfftfreq(active.size, 1.0 / plan.rate)
    inside = (frequency >= 0.5 * WISH.low) & (frequency <= 1.5 * WISH.high)
    # Edges reach beyond any band: a square keeps 5 % of its power there, a step and a binary sequence more.
    share = {"step": 0.3, "prbs": 0.85, "square": 0.9, "sawtooth": 0.9, "staircase": 0.9}.get(name, 0.98)
    assert power[inside].sum() > share * power.sum()


def test_periodic_designs_hold_whole_periods(model) -> None:  # noqa: ANN001
    for name in ("random_phase_multisine", "odd_random_phase_multisine"):
        plan = propose(name, Wish(0.1, 5.0, duration=50.0))
        period = plan.signal.period  # type: ignore[attr-defined]
        assert (period * plan.rate) == pytest.approx(round(period * plan.rate))
        assert 4.0 * period <= plan.active_time - plan.fade_in - plan.fade_out + 1e-9


@pytest.mark.parametrize(("low", "high", "duration"), [(0.0, 1.0, 10.0), (2.0, 1.0, 10.0), (1.0, 2.0, 1.0)])
def test_an_impossible_wish_is_refused(low: float, high: float, duration: float) -> None:
    with pytest.raises(ExcitationError):
        propose("chirp", Wish(low, high, duration))
    with pytest.raises(ExcitationError, match="none of chirp"):
        propose("noise", WISH)


@pytest.mark.parametrize(
    ("name", "wish", "binds"),
    [
        ("chirp", Wish(0.5, 10.0, 8.0), "velocity"),
        ("step", Wish(0.1, 2.0, 16.0), "travel"),
        ("sine", Wish(20.0, 78.0, 4.0), "cavitation"),
    ],
)
def test_the_amplitude_is_the_largest_within_the_limits(model, name: str, wish: Wish, binds: str) -> None:  # noqa: ANN001
    limits = Limits.of(model)
    if binds != "velocity":
        limits = replace(limits, velocity=10.0)
    sized = largest(propose(name, wish), model, limits)
    prediction = sized.plan.prediction
    assert prediction is not None
    assert prediction.limited_by == binds
    used = limits.used(sized.simulated, 0.0)
    assert max(used.values()) == used[binds] <= 1.0
    assert used[binds] > 0.97
    larger = replace(sized.plan, signal=sized.plan.signal.scaled(1.15), amplitude_limit=10.0)
    more = simulate_plan(larger, Plant(model))
    assert limits.used(more, 0.0)[binds] > 1.0


def test_a_drive_limit_binds_where_nothing_else_does(model) -> None:  # noqa: ANN001
    limits = replace(Limits.of(model), drive=1.0)
    sized = largest(propose("chirp", WISH), model, limits)
    assert sized.plan.prediction is not None and sized.plan.prediction.limited_by == "drive"
    assert sized.plan.amplitude_limit == 1.0
    assert np.abs(sized.simulated.record["drive"]).max() == pytest.approx(1.0, rel=0.02)


def test_limits_that_leave_no_room_are_told(model) -> None:  # noqa: ANN001
    limits = replace(Limits.of(model), pressure_min=7.149e6)
    with pytest.raises(ExcitationError, match="cavitation breaks first"):
        largest(propose("chirp", WISH), model, limits)


def test_half_the_amplitude_on_request(model) -> None:  # noqa: ANN001
    whole, half = (largest(propose("chirp", WISH), model, share=s).plan for s in (1.0, 0.5))
    assert half.signal.size == pytest.approx(0.5 * whole.signal.size, rel=0.01)
    assert half.prediction is not None and half.prediction.limited_by.startswith("50%")


def test_a_simulated_run_is_the_plant_under_the_drive_that_it_records(model) -> None:  # noqa: ANN001
    plan = load_plan("chirp")
    played = simulate_plan(plan, Plant(model))
    again = Plant(model).simulate(played.record["drive"], 1e-3)
    np.testing.assert_allclose(again.position, played.record["position"], atol=1e-9)
    assert played.extremes.position_max == pytest.approx(again.position.max(), abs=1e-9)
    assert not played.aborted


@pytest.mark.parametrize("limit", [1.0, 0.002], ids=["to its end", "broken off"])
def test_a_rehearsal_is_what_a_run_does_state_by_state(model, limit: float) -> None:  # noqa: ANN001
    """With an approach, centring and a coarse sensor; the plant goes on from each drive as it does on the bench."""
    plan = replace(propose("sine", Wish(1.0, 4.0, 4.0)), travel_limit=limit, centring_gain=30.0, centring_limit=2.0)
    assert plan.approach > 0.0
    sensors, dt = Sensors(position_resolution=1e-4), 1.0 / plan.rate
    played = simulate_plan(plan, Plant(model), sensors, position=0.2)
    run, live = ExcitationRun(plan), LivePlant(Plant(model), Plant(model).initial_state(position=0.2))
    drive, rows = 0.0, []
    while len(rows) < plan.time.size and run.phase is not Phase.ABORTED:
        now = live.step(drive, dt)
        seen = round(now.position / 1e-4) * 1e-4
        rows.append((seen, now.force, now.drive))
        drive = run.step((len(rows) - 1) * dt, seen)
    assert played.aborted == run.reason
    assert bool(run.reason) == (limit < 1.0)
    for channel, column in zip(("position", "force", "drive"), np.transpose(rows), strict=True):
        np.testing.assert_allclose(played.record[channel], column, rtol=1e-9, atol=1e-9)


def test_a_model_that_no_step_follows_says_where(model) -> None:  # noqa: ANN001
    stiff = Plant(model).with_parameters({"bulk_modulus": 1e30})
    with pytest.raises(SimulationError, match="too stiff|no longer finite"):
        simulate_plan(load_plan("chirp"), stiff)


def test_sensors_add_their_noise_and_nothing_else(model) -> None:  # noqa: ANN001
    plan = propose("sine", Wish(1.0, 4.0, 4.0))
    plant = Plant(model)
    quiet, noisy = simulate_plan(plan, plant), simulate_plan(plan, plant, Sensors(20e-6, 24e-6, 15e3, 1))
    difference = noisy.record["position"] - quiet.record["position"]
    assert np.std(difference) == pytest.approx(np.hypot(20e-6, 24e-6 / np.sqrt(12.0)), rel=0.1)
    assert np.std(noisy.record["pressure_a"] - quiet.record["pressure_a"]) == pytest.approx(15e3, rel=0.1)


def test_an_approach_centres_the_piston_and_lifts_the_travel_limit(model) -> None:  # noqa: ANN001
    plan = replace(propose("sine", Wish(1.0, 4.0, 4.0)), travel_limit=0.1)
    assert plan.approach > 0.0
    played = simulate_plan(plan, Plant(model), position=0.5)
    assert not played.aborted
    arrived = played.record["position"][round(plan.approach * plan.rate)]
    assert abs(arrived) < 0.01
    stuck = replace(plan, approach_gain=0.0)
    assert "the piston is at 500." in simulate_plan(stuck, Plant(model), position=0.5).aborted


def test_without_an_approach_a_run_is_as_before() -> None:
    plan = Plan("any", Sine(1.0, 1.0), 0.5, duration=2.0)
    assert plan.approach == 0.0 and plan.signal_start == plan.rest_before
    run = ExcitationRun(plan)
    for index in range(plan.time.size):
        drive = run.step(index / plan.rate, 0.0)
        assert drive == pytest.approx(plan.open_loop[index])
    assert run.phase is Phase.PLAYING


def test_the_plan_file_holds_its_prediction(model, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:  # noqa: ANN001
    arguments = ["design", "low_crest_multisine", "--model", BENCH, "--band", "0.5", "10", "--duration", "9"]
    out = tmp_path / "design"
    assert run_verb("hydraulic_sysid", [*arguments, "--travel", "0.05", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    plan = load_plan(out / "low_crest_multisine.yaml")
    assert plan.prediction is not None and plan.prediction.model == BENCH
    assert f"{plan.prediction.limited_by} allows no more" in " ".join(text.split())
    again = simulate_plan(plan, Plant(model)).extremes
    assert again.velocity_peak == pytest.approx(plan.prediction.velocity_peak)
    assert max(again.position_max, -again.position_min) <= 0.05
    document = json.loads((out / "design.json").read_text())
    assert document["limits"]["travel"] == 0.05
    assert document["plans"][0]["crest_factor"] < 2.0
    assert_cannot_inject(document)
    assert run_verb("hydraulic_sysid", [*arguments, "--out", str(out)]) == 2
    assert "a plan is never overwritten" in capsys.readouterr().err


def test_realisations_have_one_amplitude_and_phases_of_their_own(tmp_path: Path) -> None:
    out = tmp_path / "three"
    arguments = ["--band", "0.5", "10", "--duration", "9", "--part", "0.3", "--realisations", "2"]
    arguments = ["design", "odd_random_phase_multisine", "--model", BENCH, *arguments, "--out", str(out)]
    assert run_verb("hydraulic_sysid", arguments) == 0
    one, two = (load_plan(out / f"odd_random_phase_multisine_{n}.yaml") for n in (1, 2))
    assert one.signal.size == pytest.approx(two.signal.size, rel=1e-6)
    np.testing.assert_array_equal(one.signal.lines(), two.signal.lines())  # type: ignore[attr-defined]
    assert np.abs(one.open_loop - two.open_loop).max() > 0.1


def test_a_band_below_what_the_duration_holds_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["design", "chirp", "--model", "sample_bench", "--duration", "10", "--out"]
    assert run_verb("hydraulic_sysid", [*arguments, str(tmp_path / "short")]) == 0
    assert "periods of the lowest frequency: play it longer" in " ".join(capsys.readouterr().out.split())
    # With friction, which a probe sees, the same actuator is much better damped.
    assert run_verb("hydraulic_sysid", [*arguments, str(tmp_path / "probed"), "--probe", "probe"]) == 0
    low, wide = (json.loads((tmp_path / n / "design.json").read_text())["bandwidth"] for n in ("short", "probed"))
    assert wide > 2.0 * low
