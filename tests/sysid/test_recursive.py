"""Recursive ARX: the batch's answer, a plant that changes, silence, gaps; and what feeds it while the bench runs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_interfaces.samples import PlantSample
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.resampling import held_average, sampled
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.models import ArxOrder, IdentificationError, RecursiveArx, fit_arx
from hydraulic_sysid.linear.online import LiveModel, RecentRms, RunningFit, SlowSampler

ORDER = ArxOrder(2, 2, 1)
FIRST, SECOND = ([1.0, -1.5, 0.7], [0.0, 1.0, 0.5]), ([1.0, -1.2, 0.5], [0.0, 0.6, 0.9])


def drive(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


def feed(estimate: RecursiveArx, u: np.ndarray, y: np.ndarray) -> None:
    """Sample k comes with the drive that was applied before it."""
    for k in range(1, y.size):
        estimate.update(float(u[k - 1]), float(y[k]))


@pytest.mark.parametrize("order", [ArxOrder(2, 2, 1), ArxOrder(3, 1, 3), ArxOrder(1, 4, 2)])
def test_without_forgetting_it_is_the_least_squares_of_all_samples(order: ArxOrder) -> None:
    u = 2.0 * drive(600)
    y = 1e-3 * (lfilter(FIRST[1], FIRST[0], u) + 0.1 * drive(600, 1) + 0.4)
    estimate = RecursiveArx(order, 0.05, 1.0, input_scale=2.0, output_scale=1e-3)
    feed(estimate, u, y)
    # Its first sample has no drive before it: it looks back one sample more than the batch where nb + nk − 1 > na.
    skip = 1 if order.memory > order.na else 0
    batch = fit_arx([u[skip - 1 if skip else 0 :]], [y[skip - 1 if skip else 0 :]], 0.05, order)
    expected = np.array([*batch.a, *batch.b, batch.constant])
    np.testing.assert_allclose(estimate.theta, expected, atol=2e-5 * np.abs(expected).max(), rtol=2e-4)
    np.testing.assert_allclose(estimate.standard_errors, batch.standard_errors, rtol=0.02)
    assert estimate.model().loss == pytest.approx(batch.loss, rel=0.05)
    assert estimate.names() == [name for name, *_ in batch.coefficients()]


def test_it_follows_a_plant_that_changes_and_faster_when_it_may_forget() -> None:
    u = drive(1200)
    y = np.concatenate((lfilter(FIRST[1], FIRST[0], u)[:600], lfilter(SECOND[1], SECOND[0], u)[600:]))
    y = y + 0.01 * drive(1200, 1)
    errors = {}
    for forgetting in (1.0, 0.98):
        estimate = RecursiveArx(ORDER, 0.05, forgetting)
        feed(estimate, u, y)
        errors[forgetting] = np.abs(estimate.theta[:2] - SECOND[0][1:]).max()
    assert errors[0.98] < 0.02 < 0.1 < errors[1.0]


def test_a_reset_forgets_at_once() -> None:
    u = drive(700)
    y = np.concatenate((lfilter(FIRST[1], FIRST[0], u)[:600], lfilter(SECOND[1], SECOND[0], u)[600:]))
    estimates = []
    for reset in (False, True):
        estimate = RecursiveArx(ORDER, 0.05, 1.0, constant=False)
        feed(estimate, u[:603], y[:603])
        if reset:
            estimate.reset_covariance()
            assert estimate.certainty == 1.0
        feed(estimate, u[602:], y[602:])
        estimates.append(np.abs(estimate.theta[:2] - SECOND[0][1:]).max())
    assert estimates[1] < 1e-3 < 0.05 < estimates[0]


def test_silence_does_not_wind_it_up() -> None:
    """Thousands of samples without motion, and then a kick: the estimate must still be there."""
    u = np.concatenate((drive(500), np.zeros(5000), drive(40, 3)))
    y = lfilter(FIRST[1], FIRST[0], u) + 1e-3 * drive(u.size, 4)
    estimate = RecursiveArx(ORDER, 0.05, 0.98)
    feed(estimate, u[:5500], y[:5500])
    assert estimate.certainty < 1e-3
    assert estimate.updates < 700
    np.testing.assert_allclose(estimate.theta[:2], FIRST[0][1:], atol=0.02)
    feed(estimate, u[5499:], y[5499:])
    np.testing.assert_allclose(estimate.theta[:2], FIRST[0][1:], atol=0.02)


def test_a_drive_too_poor_for_the_order_does_not_wind_it_up() -> None:
    """A single tone tells two coefficients: the directions that it leaves out keep a bounded uncertainty."""
    u = np.sin(0.3 * np.arange(20_000))
    y = lfilter(FIRST[1], FIRST[0], u) + 1e-3 * drive(u.size, 4)
    estimate = RecursiveArx(ArxOrder(3, 3, 1), 0.05, 0.9)
    feed(estimate, u, y)
    assert estimate.certainty <= 1.0
    assert np.isfinite(estimate.theta).all()


def test_standard_errors_are_right_on_average() -> None:
    found, claimed = [], []
    for seed in range(40):
        u = drive(500, seed)
        y = lfilter(FIRST[1], FIRST[0], u) + lfilter([1.0], FIRST[0], 0.3 * drive(500, seed + 900))
        estimate = RecursiveArx(ORDER, 0.05, 1.0)
        feed(estimate, u, y)
        found.append(estimate.theta)
        claimed.append(estimate.standard_errors)
    np.testing.assert_allclose(np.mean(claimed, axis=0), np.std(found, axis=0, ddof=1), rtol=0.4)


def test_a_gap_costs_the_past_and_not_the_estimate() -> None:
    u = drive(400)
    y = lfilter(FIRST[1], FIRST[0], u)
    estimate = RecursiveArx(ORDER, 0.05)
    feed(estimate, u, y)
    before = estimate.theta
    estimate.forget_past()
    assert estimate.update(0.0, 7.0) is None
    np.testing.assert_array_equal(estimate.theta, before)
    with pytest.raises(IdentificationError, match="dead time"):
        RecursiveArx(ArxOrder(2, 2, 0), 0.05)
    with pytest.raises(IdentificationError, match="0.5 … 1"):
        estimate.forgetting = 1.2


@pytest.mark.parametrize("period_ms", [50, 7, 1])
def test_the_stream_is_sampled_as_a_record_is(period_ms: int) -> None:
    rng = np.random.default_rng(5)
    u, y = rng.standard_normal((2, 1000))
    sampler = SlowSampler(period_ms * 1_000_000, 20_000_000)
    found = [s for k in range(1000) for s in sampler.take(k * 1_000_000, u[k], y[k])]
    slow_u, slow_y = held_average(u, 1e-3, 1e-3 * period_ms), sampled(y, 1e-3, 1e-3 * period_ms)
    count = min(len(found), slow_u.size - 1)
    np.testing.assert_allclose([s.drive for s in found[:count]], slow_u[:count], atol=1e-9)
    np.testing.assert_allclose([s.output for s in found[:count]], slow_y[1 : count + 1], atol=1e-9)
    assert [s.follows for s in found[:3]] == [False, True, True]


def test_lost_samples_are_bridged_and_long_gaps_are_not() -> None:
    sampler = SlowSampler(10_000_000, 20_000_000)
    stamps = [t for t in range(60) if t not in (13, 14, 15)]
    found = [s for t in stamps for s in sampler.take(t * 1_000_000, 2.0, float(t))]
    assert [s.output for s in found] == [10.0, 20.0, 30.0, 40.0, 50.0]
    assert all(s.drive == pytest.approx(2.0) for s in found)
    assert sampler.take(200_000_000, 2.0, 200.0) == []
    (later,) = [s for t in range(201, 211) for s in sampler.take(t * 1_000_000, 2.0, float(t))]
    assert later.output == 210.0 and not later.follows


def test_the_running_fit_without_forgetting_is_the_best_fit() -> None:
    y, p = drive(300), drive(300) + 0.1 * drive(300, 1)
    fit = RunningFit(1.0)
    for a, b in zip(y, p, strict=True):
        fit.take(float(a), float(b))
    assert fit.best_fit == pytest.approx(metrics.best_fit(y, p), rel=1e-9)
    assert fit.rms == pytest.approx(metrics.rmse(y, p), rel=1e-9)
    assert np.isnan(RunningFit(0.9).best_fit)


def stream(values: dict[str, np.ndarray], u: np.ndarray, dt: float) -> list[PlantSample]:
    return [
        PlantSample(
            round(k * dt * 1e9), float(values["position"][k]), float(values["velocity"][k]),
            float(values["force"][k]), float(u[k]),
        )
        for k in range(u.size)
    ]  # fmt: skip


def test_the_right_model_beside_the_plant_leaves_nothing() -> None:
    model = load_model("moog_mcr_m_1002_bench")
    u = 2.0 * np.sin(2 * np.pi * 1.0 * 1e-3 * np.arange(3000))
    truth = Plant(model).simulate(u, 1e-3)
    live = LiveModel(model, horizon=0.5)
    pairs = [live.take(s) for s in stream(truth, u, 1e-3)]
    assert pairs[0] is None and all(pairs[1:])
    residual = np.array([p[1].position for p in pairs[1:]])
    stamps = np.array([p[0].stamp_ns for p in pairs[1:]])
    np.testing.assert_array_equal(stamps, 1_000_000 * np.arange(2999))
    assert np.abs(residual).max() < 2e-3 * np.ptp(truth["position"])
    assert live.restarts == 6


def test_a_wrong_model_drifts_until_it_restarts_from_the_measurement() -> None:
    model = load_model("moog_mcr_m_1002_bench")
    u = np.full(3000, 1.0)
    truth = Plant(model).simulate(u, 1e-3)
    wrong = model.with_values({"valve_flow": 0.8 * model.value("valve_flow")})
    largest = {}
    for horizon in (0.0, 0.5):
        live = LiveModel(wrong, horizon)
        pairs = [p for s in stream(truth, u, 1e-3) if (p := live.take(s))]
        largest[horizon] = max(abs(p[1].position) for p in pairs)
        late = [p[1].velocity for p in pairs[-400:]]
        assert np.mean(late) == pytest.approx(0.2 * truth["velocity"][-1], rel=0.15)
    assert largest[0.5] < 0.3 * largest[0.0]
    gap = LiveModel(wrong)
    samples = stream(truth, u, 1e-3)
    assert gap.take(samples[0]) is None and gap.take(samples[1]) is not None
    assert gap.take(samples[100]) is None and gap.restarts == 2


def test_the_rms_of_the_last_reports_forgets_what_is_older() -> None:
    recent = RecentRms(2)
    assert math.isnan(recent.next())
    for value in (3.0, -3.0, math.nan):
        recent.take(value)
    assert recent.next() == pytest.approx(3.0)
    recent.take(1.0)
    assert recent.next() == pytest.approx(math.sqrt(19.0 / 3.0)), "two reports, three samples"
    recent.take(1.0)
    assert recent.next() == pytest.approx(1.0)
