"""Continuous-time transfer functions: known plants recovered, peers agreed with, the nonlinear plant fitted."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy import signal

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.models import (
    IdentificationError,
    TransferFunctionModel,
    TransferFunctionOrder,
    fit_transfer_function,
)

DT = 0.005
W, ZETA, GAIN = 2.0 * np.pi * 8.0, 0.3, 0.05
NUM, DEN = np.array([GAIN * W * W]), np.array([1.0, 2.0 * ZETA * W, W * W, 0.0])


def three_tones(n: int, dt: float, bandwidth: float, amplitude: float) -> np.ndarray:
    t = dt * np.arange(n)
    return amplitude * sum(np.sin(2 * np.pi * bandwidth * m * t + p) for m, p in ((0.1, 0.0), (0.5, 1.0), (2.0, 2.0)))


def response(num, den, u: np.ndarray, dt: float, x0=0.0) -> np.ndarray:
    """Response of a plant to a held input, by `control`."""
    plant = control.c2d(control.ss(control.tf(num, den)), dt)
    return control.forced_response(plant, dt * np.arange(u.size), u, X0=x0)[1].ravel()


def test_an_integrating_plant_is_recovered_to_the_last_digits() -> None:
    u = three_tones(4000, DT, 4.0, 2.0)
    model = fit_transfer_function([u], [response(NUM, DEN, u, DT, [0.1, 0.01, 0.001])], DT)
    assert model.converged
    np.testing.assert_allclose(model.numerator, NUM, rtol=1e-7)
    np.testing.assert_allclose(model.denominator[:3], DEN[:3], rtol=1e-7)
    assert abs(model.denominator[3]) < 1e-6 * W**3


@pytest.mark.parametrize("dt", [0.001, 0.005, 0.05])
def test_noise_moves_the_estimate_by_what_its_standard_errors_say(dt: float) -> None:
    rng = np.random.default_rng(1)
    u = three_tones(round(40.0 / dt), dt, 3.0, 2.0)
    y = response(NUM, DEN, u, dt) + 2e-4 * rng.standard_normal(u.size)
    model = fit_transfer_function([u], [y], dt, TransferFunctionOrder(3, 0, integrator=True))
    found = np.array([value for _, value, _ in model.coefficients()])
    errors = np.array([error for *_, error in model.coefficients()])
    truth = np.array([*DEN[1:3], NUM[0], 0.0])
    assert (np.abs(found - truth) < 4.0 * errors).all()
    assert (errors[:3] < 0.1 * np.abs(truth[:3])).all()
    assert model.loss == pytest.approx(2e-4**2, rel=0.1)


@pytest.mark.parametrize(("poles", "zeros"), [(1, 0), (2, 1), (4, 1), (4, 0), (2, 2)])
def test_other_orders_are_recovered(poles: int, zeros: int) -> None:
    rng = np.random.default_rng(2)
    roots = [-3.0, -20.0, -8.0 + 30.0j, -8.0 - 30.0j]
    den = np.real(np.poly(roots[:poles] if poles != 2 else roots[2:]))
    num = 40.0 * np.real(np.poly([-12.0, -50.0][:zeros]))
    u = np.repeat(rng.standard_normal(300), 10)
    y = response(num, den, u, DT) + 0.3
    model = fit_transfer_function([u], [y], DT, TransferFunctionOrder(poles, zeros))
    np.testing.assert_allclose(model.denominator, den, rtol=1e-5)
    np.testing.assert_allclose(model.numerator, num, rtol=1e-5)
    assert model.constant / den[-1] == pytest.approx(0.3, rel=1e-5)


def test_a_dead_time_between_samples_is_exact() -> None:
    """A delay of 2.4 samples, against the same plant sampled five times as fast."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.standard_normal(200), 4)
    fine = np.repeat(u, 5)
    delayed = np.concatenate((np.full(12, u[0]), fine[:-12]))
    y = response(NUM, DEN, delayed, DT / 5.0)[::5]
    model = fit_transfer_function([u], [y], DT, delay=2.4 * DT)
    np.testing.assert_allclose(model.numerator, NUM, rtol=1e-6)
    assert metrics.best_fit(y, model.simulate(u, y)) > 99.9999


def test_experiments_share_the_model_and_keep_their_initial_states() -> None:
    us = [three_tones(1500, DT, f, 1.0) for f in (2.0, 5.0)]
    ys = [response(NUM, DEN, u, DT, x0) for u, x0 in zip(us, ([1.0, 0.0, 0.0], [0.0, -3.0, 0.1]), strict=True)]
    model = fit_transfer_function(us, ys, DT)
    np.testing.assert_allclose(model.numerator, NUM, rtol=1e-7)
    for u, y in zip(us, ys, strict=True):
        assert metrics.best_fit(y, model.simulate(u, y)) > 99.99999


def test_free_run_response_and_margins_agree_with_control_and_scipy() -> None:
    u = three_tones(2000, DT, 4.0, 2.0)
    y = response(NUM, DEN, u, DT)
    model = fit_transfer_function([u], [y], DT, TransferFunctionOrder(3, 0, integrator=True), offsets="none")
    num, den = model.transfer_function()
    np.testing.assert_allclose(model.simulate(u), response(num, den, u, DT), atol=1e-9 * np.ptp(y))
    sampled = signal.cont2discrete(signal.tf2ss(num, den), DT)
    np.testing.assert_allclose(model.simulate(u), signal.dlsim(sampled, u)[1].ravel(), atol=1e-9 * np.ptp(y))
    # Gain margin of K·ω²/(s³ + 2ζω·s² + ω²·s): 2ζω/K, where the phase is −180°, at ω.
    gain_margin, phase_margin, w180, _ = control.margin(control.tf(num, den))
    assert gain_margin == pytest.approx(2.0 * ZETA * W / GAIN, rel=1e-6)
    assert w180 == pytest.approx(W, rel=1e-6)
    w, h = signal.freqs(num, den, worN=[1.0, 10.0, W])
    np.testing.assert_allclose(h, control.tf(num, den)(1j * w), rtol=1e-9)


def test_refined_instruments_alone_come_close_to_the_output_error_fit() -> None:
    rng = np.random.default_rng(4)
    u = np.repeat(rng.standard_normal(800), 5)
    y = response([400.0], [1.0, 8.0, 400.0], u, DT) + 0.05 * rng.standard_normal(u.size)
    order = TransferFunctionOrder(2, 0)
    srivc, refined = (fit_transfer_function([u], [y], DT, order, method=m) for m in ("srivc", "output error"))
    assert refined.loss <= srivc.loss <= 1.001 * refined.loss
    np.testing.assert_allclose(srivc.denominator, refined.denominator, rtol=0.01)


def test_one_step_ahead_uses_the_colour_of_the_error() -> None:
    rng = np.random.default_rng(5)
    u = np.repeat(rng.standard_normal(800), 5)
    v = signal.lfilter([1.0], [1.0, -0.9], 0.01 * rng.standard_normal(u.size))
    y = response([400.0], [1.0, 8.0, 400.0], u, DT) + v
    model = fit_transfer_function([u], [y], DT, TransferFunctionOrder(2, 0))
    assert model.noise[0] == pytest.approx(-0.9, abs=0.03)
    error = (y - model.predict(u, y))[model.memory :]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.01, rel=0.05)
    assert model.one_step_loss == pytest.approx(np.mean(error**2), rel=0.01)


@pytest.fixture(scope="module")
def bench() -> Plant:
    return Plant(load_model("moog_mcr_m_1002_bench"))


@pytest.mark.parametrize("dt_model", [0.001, 0.05])
def test_the_nonlinear_plant_is_fitted_on_test_data(bench: Plant, dt_model: float) -> None:
    from hydraulic_sysid.data.resampling import held_average, sampled

    u = three_tones(50_000, 1e-3, 1.5, 2.0)
    y = bench.simulate(u, 1e-3)["position"] + 1e-4 * np.random.default_rng(6).standard_normal(u.size)
    u, y = held_average(u, 1e-3, dt_model), sampled(y, 1e-3, dt_model)
    half = u.size // 2
    model = fit_transfer_function([u[:half]], [y[:half]], dt_model)
    assert metrics.best_fit(y[half:], model.simulate(u[half:], y[half:])) > 99.17


@pytest.mark.parametrize(
    ("u", "y", "options", "word"),
    [
        (np.ones(200), np.arange(200.0), {}, "must move"),
        (np.arange(12.0), np.arange(12.0), {}, "too few"),
        (np.arange(9.0), np.arange(8.0), {}, "equal"),
        (np.arange(200.0), np.arange(200.0), {"delay": -1.0}, "not negative"),
        (np.arange(200.0), np.arange(200.0), {"method": "magic"}, "none of"),
        (np.arange(200.0), np.full(200, np.nan), {}, "finite"),
        (np.sin(np.arange(400.0)), np.sin(np.arange(400.0) - 1.0), {"order": (6, 6)}, "condition number|excite"),
    ],
)
def test_data_that_cannot_identify_say_why(u: np.ndarray, y: np.ndarray, options: dict, word: str) -> None:
    if "order" in options:
        options = {"order": TransferFunctionOrder(*options["order"])}
    with pytest.raises(IdentificationError, match=word):
        fit_transfer_function([u], [y], DT, **options)


def test_a_model_that_blows_up_has_no_free_run() -> None:
    u = three_tones(2000, DT, 4.0, 2.0)
    fitted = fit_transfer_function([u], [response(NUM, DEN, u, DT)], DT)
    changed = {**fitted.__dict__, "denominator": np.array([1.0, -20.0, 100.0, 0.0])}
    assert np.isnan(TransferFunctionModel(**changed).simulate(u, u)).all()
