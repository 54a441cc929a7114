"""Subspace identification: published examples, peers, a constant, several records, the nonlinear plant."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.models import IdentificationError, fit_state_space

# P. Van Overschee, B. De Moor, Subspace Identification for Linear Systems, Kluwer 1996: the system of the tutorial
# example that comes with the book (first input and output), poles at ±0.603 ± 0.603i.
A = np.array([[0.603, 0.603, 0, 0], [-0.603, 0.603, 0, 0], [0, 0, -0.603, -0.603], [0, 0, 0.603, -0.603]])
B, C, D = np.array([1.1650, 0.6268, 0.0751, 0.3516]), np.array([0.2641, -1.4462, 1.2460, 0.5774]), -0.1356
K = np.array([0.1242, -0.0828, 0.0390, -0.1225])


def run(u: np.ndarray, e: np.ndarray, x=None, a=A, b=B, c=C, d=D, k=K) -> np.ndarray:
    a, b, c, k = np.atleast_2d(a), np.atleast_1d(b), np.atleast_1d(c), np.atleast_1d(k)
    x = np.zeros(c.size) if x is None else np.asarray(x, dtype=float)
    y = np.empty(u.size)
    for t in range(u.size):
        y[t] = c @ x + d * u[t] + e[t]
        x = a @ x + b * u[t] + k * e[t]
    return y


def by_place(values) -> np.ndarray:
    return np.array(sorted(values, key=lambda z: (round(z.real, 3), z.imag)))


def test_published_example_without_noise_is_exact() -> None:
    u = np.random.default_rng(0).standard_normal(1000)
    y = run(u, np.zeros(u.size))
    model = fit_state_space([u], [y], 1.0, 4, direct=True, offsets="none")
    np.testing.assert_allclose(by_place(p.value for p in model.poles()), by_place(np.linalg.eigvals(A)), atol=1e-8)
    num, den = model.transfer_function()
    truth = control.ss2tf(control.ss(A, B[:, None], C[None, :], [[D]], 1.0))
    np.testing.assert_allclose(num, truth.num[0][0], atol=1e-8)
    np.testing.assert_allclose(den, truth.den[0][0], atol=1e-8)
    assert model.singular_values[4] < 1e-10 * model.singular_values[3]  # the gap that tells the order
    np.testing.assert_allclose(model.simulate(u), y, atol=1e-8)


def test_published_example_with_noise() -> None:
    """Poles, gain and the innovations' variance; one step ahead only the innovations are left."""
    rng = np.random.default_rng(1)
    u, e = rng.standard_normal((2, 8000))
    e *= 0.5
    y = run(u, e)
    model = fit_state_space([u], [y], 1.0, 4, direct=True)
    np.testing.assert_allclose(by_place(p.value for p in model.poles()), by_place(np.linalg.eigvals(A)), atol=0.02)
    w = np.linspace(0.05, 3.0, 40)
    found = control.tf(*model.transfer_function(), 1.0)(np.exp(1j * w))
    truth = control.ss(A, B[:, None], C[None, :], [[D]], 1.0)(np.exp(1j * w))
    assert np.abs(found - truth).max() < 0.05 * np.abs(truth).max()
    half = np.sqrt(np.mean((y - model.predict(u, y)) ** 2))
    assert half == pytest.approx(0.5, rel=0.02)
    assert model.one_step_loss < 0.9 * model.loss
    np.testing.assert_allclose(model.loss, np.mean((y - model.simulate(u, y)) ** 2), rtol=0.05)


def test_published_first_order_example_is_unbiased() -> None:
    """The system of figure 4.9 of the book, on which the bias of algorithms is shown: a mean over experiments."""
    a, b, c, d, k, r = 0.949, 1.8805, 0.8725, -2.0895, -0.0580, 6.705
    found = []
    for seed in range(20):
        u, e = np.random.default_rng(seed).standard_normal((2, 2000))
        y = run(u, np.sqrt(r) * e, None, a, b, c, d, k)
        model = fit_state_space([u], [y], 1.0, 1, direct=True, offsets="none", horizon=10)
        found.append([model.poles()[0].value.real, model.D, float(model.B[0] * model.C[0])])
    error = np.mean(found, axis=0) - [a, d, b * c]
    deviation = np.std(found, axis=0, ddof=1) / np.sqrt(len(found))
    assert (np.abs(error) < 4.0 * deviation + 1e-3).all()
    assert (deviation < [0.002, 0.02, 0.02]).all()


def test_the_gain_is_the_kalman_gain() -> None:
    """Of a system with known noise covariances, against the Riccati equation."""
    rng = np.random.default_rng(2)
    a, c = np.array([[0.8, 0.3], [-0.2, 0.7]]), np.array([1.0, 0.5])
    q, r = 0.2, 1.0
    p = solve_discrete_are(a.T, c[:, None], q * np.eye(2), [[r]])
    k = a @ p @ c / (c @ p @ c + r)
    n = 40_000
    u, v, w = rng.standard_normal(n), np.sqrt(r) * rng.standard_normal(n), np.sqrt(q) * rng.standard_normal((n, 2))
    x, y = np.zeros(2), np.empty(n)
    for t in range(n):
        y[t] = c @ x + v[t]
        x = a @ x + np.array([1.0, -0.5]) * u[t] + w[t]
    model = fit_state_space([u], [y], 1.0, 2)
    # The poles of the predictor do not depend on the coordinates of the state.
    poles = np.linalg.eigvals(model.A - np.outer(model.K, model.C))
    np.testing.assert_allclose(by_place(poles), by_place(np.linalg.eigvals(a - np.outer(k, c))), atol=0.05)
    assert model.one_step_loss == pytest.approx(c @ p @ c + r, rel=0.03)


def test_constants_and_initial_states_of_several_records_are_found() -> None:
    rng = np.random.default_rng(3)
    us = list(rng.standard_normal((2, 800)))
    ys = [run(u, np.zeros(800), x) + 5.0 for u, x in zip(us, ([9, 0, 0, 0], [0, -5, 3, 0]), strict=True)]
    model = fit_state_space(us, ys, 1.0, 4, direct=True)
    for u, y in zip(us, ys, strict=True):
        assert metrics.best_fit(y, model.simulate(u, y)) > 99.99999


def test_an_integrating_nonlinear_plant_is_fitted() -> None:
    rng = np.random.default_rng(4)
    u = np.repeat(rng.uniform(-2.0, 2.0, 60), 500)
    y = Plant(load_model("moog_mcr_m_1002_bench")).simulate(u, 1e-3)["position"][::10]
    u = u[::10]
    y = y + 1e-4 * rng.standard_normal(y.size)
    model = fit_state_space([u[:2400]], [y[:2400]], 0.01, 3)
    assert metrics.best_fit(y[2400:], model.simulate(u[2400:], y[2400:])) > 98.0
    assert metrics.best_fit(y[2400:], model.predict(u[2400:], y[2400:])) > 98.0


@pytest.mark.parametrize(
    ("u", "order", "options", "word"),
    [
        (np.sin(np.arange(500.0)), 2, {}, "not rich enough"),
        (np.random.default_rng(0).standard_normal(60), 2, {}, "too few"),
        (np.random.default_rng(0).standard_normal(600), 0, {}, "at least one state"),
        (np.random.default_rng(0).standard_normal(600), 12, {"horizon": 10}, "must exceed"),
        (np.random.default_rng(0).standard_normal(600), 8, {"offsets": "none"}, "no more than 4 states"),
    ],
)
def test_data_that_cannot_identify_say_why(u: np.ndarray, order: int, options: dict, word: str) -> None:
    with pytest.raises(IdentificationError, match=word):
        fit_state_space([u], [run(u, np.zeros(u.size))], 1.0, order, **options)
