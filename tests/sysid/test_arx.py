"""ARX models recover known systems, and their figures mean what they say."""

from __future__ import annotations

import control
import numpy as np
import pytest
from scipy.signal import dlsim, freqz, lfilter

from hydraulic_sysid.linear.models import ArxOrder, IdentificationError, fit_arx, fit_arx_instruments

A = np.array([-1.5, 0.7, -0.05])
B = np.array([0.4, -0.2, 0.1])


def system(u: np.ndarray, nk: int, noise: float, seed: int, constant: float = 0.0) -> np.ndarray:
    e = noise * np.random.default_rng(seed).standard_normal(u.size)
    den = np.concatenate(([1.0], A))
    return lfilter(np.concatenate((np.zeros(nk), B)), den, u) + lfilter([1.0], den, e + constant)


def excite(n: int = 4000, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize("nk", [0, 1, 3])
def test_noise_free_system_is_recovered(nk: int) -> None:
    u = excite()
    model = fit_arx([u], [system(u, nk, 0.0, 1)], 0.05, ArxOrder(3, 3, nk))
    assert np.allclose(model.a, A, atol=1e-8)
    assert np.allclose(model.b, B, atol=1e-8)
    assert model.loss < 1e-18


def test_standard_errors_cover_the_truth() -> None:
    """Over repeated experiments the parameters scatter by what the standard errors say."""
    theta, claimed = [], []
    for seed in range(60):
        u = excite(800, seed)
        model = fit_arx([u], [system(u, 1, 0.3, seed + 1000)], 0.05, ArxOrder(3, 3, 1))
        theta.append(np.concatenate((model.a, model.b)))
        claimed.append(model.standard_errors[:6])
    scatter = np.std(theta, axis=0, ddof=1)
    assert np.allclose(np.mean(claimed, axis=0), scatter, rtol=0.35)
    assert model.loss == pytest.approx(0.09, rel=0.15)


def test_estimated_and_removed_offsets_give_the_same_dynamics() -> None:
    u = excite() + 0.8
    y = system(u, 1, 0.01, 5, constant=0.3)
    estimated = fit_arx([u], [y], 0.05, ArxOrder(3, 3, 1), "estimate")
    removed = fit_arx([u], [y], 0.05, ArxOrder(3, 3, 1), "remove")
    ignored = fit_arx([u], [y], 0.05, ArxOrder(3, 3, 1), "none")
    assert estimated.constant == pytest.approx(0.3, abs=0.02)
    assert np.allclose(estimated.a, A, atol=0.01)
    assert np.allclose(removed.a, A, atol=0.02)
    assert ignored.loss > 5 * estimated.loss


def test_several_experiments_are_not_glued_together() -> None:
    """A jump between two records must not look like dynamics."""
    u1, u2 = excite(500, 1), excite(500, 2)
    y1, y2 = system(u1, 1, 0.0, 3), system(u2, 1, 0.0, 4)
    y2 = y2 + lfilter([1.0], np.concatenate(([1.0], A)), np.concatenate(([50.0], np.zeros(499))))
    model = fit_arx([u1, u2], [y1, y2], 0.05, ArxOrder(3, 3, 1))
    assert np.allclose(model.a, A, atol=1e-8)


def test_free_run_finds_the_initial_state_and_prediction_needs_a_past() -> None:
    u = excite(600)
    y = system(u, 1, 0.0, 1)
    model = fit_arx([u], [y], 0.05, ArxOrder(3, 3, 1))
    part = slice(200, 600)
    assert np.allclose(model.simulate(u[part], y[part]), y[part], atol=1e-6)
    assert np.abs(model.simulate(u[part]) - y[part])[:3].max() > 1e-3
    one = model.predict(u[part], y[part])
    assert np.isnan(one[:3]).all()
    assert np.allclose(one[3:], y[part][3:], atol=1e-8)


def test_transfer_function_is_what_python_control_takes() -> None:
    control = pytest.importorskip("control")
    u = excite(300)
    for nk in (0, 1, 3):
        model = fit_arx([u], [system(u, nk, 0.0, 1)], 0.05, ArxOrder(3, 3, nk))
        num, den = model.transfer_function()
        response = control.forced_response(control.TransferFunction(num, den, 0.05), inputs=u)
        assert np.allclose(np.squeeze(response.outputs), system(u, nk, 0.0, 1), atol=1e-6)


def test_poles_of_a_known_oscillator_and_integrator() -> None:
    dt, wn, zeta = 0.01, 2 * np.pi * 4.0, 0.2
    s = wn * (-zeta + 1j * np.sqrt(1 - zeta**2))
    den = np.real(np.poly([1.0, np.exp(s * dt), np.exp(np.conj(s) * dt)]))
    u = excite(4000)
    model = fit_arx([u], [lfilter([0.0, 0.1, 0.2, 0.1], den, u)], dt, ArxOrder(3, 3, 1))
    slow, *pair = model.poles()
    assert slow.value == pytest.approx(1.0, abs=1e-6)
    assert slow.natural_frequency < 1e-3
    for pole in pair:
        assert pole.natural_frequency == pytest.approx(4.0, rel=1e-4)
        assert pole.damping == pytest.approx(zeta, rel=1e-3)
        assert pole.stable


@pytest.mark.parametrize(
    ("u", "y", "word"),
    [
        (np.zeros(100), np.ones(100), "zero throughout"),
        (np.ones(100), np.ones(100), "excite"),
        (np.ones(8), np.ones(8), "too few"),
        (np.ones(8), np.ones(9), "equal"),
    ],
)
def test_data_that_cannot_identify_say_why(u: np.ndarray, y: np.ndarray, word: str) -> None:
    with pytest.raises(IdentificationError, match=word):
        fit_arx([u], [y], 0.05, ArxOrder(3, 3, 1))


def test_order_is_checked() -> None:
    with pytest.raises(IdentificationError, match="na and nb"):
        ArxOrder(0, 1, 1)


def test_unstable_model_has_no_free_run() -> None:
    """A record whose output grows without its input gives a model that cannot be run; that is told, not hidden."""
    u = excite(400)
    y = lfilter([0.0, 1.0], [1.0, -1.2], u)
    model = fit_arx([u], [y], 0.05, ArxOrder(1, 1, 1))
    assert not model.poles()[0].stable
    assert np.isnan(model.simulate(u, y)).all()
    assert np.allclose(model.predict(u, y)[-50:], y[-50:])


@pytest.mark.parametrize("order", [ArxOrder(1, 1, 0), ArxOrder(3, 3, 1), ArxOrder(5, 2, 3), ArxOrder(8, 8, 1)])
@pytest.mark.parametrize("count", [300, 70_000])
def test_parameters_agree_with_plain_least_squares(order: ArxOrder, count: int) -> None:
    """The blocks are put together to what `numpy.linalg.lstsq` makes of the whole regression matrix."""
    u = excite(count, 7)
    y = system(u, 1, 0.1, 8, constant=0.2)
    first = max(order.na, order.nb + order.nk - 1)
    columns = [-y[first - i : count - i] for i in range(1, order.na + 1)]
    columns += [u[first - i : count - i] for i in range(order.nk, order.nk + order.nb)]
    matrix = np.column_stack([*columns, np.ones(count - first)])
    reference, squares, *_ = np.linalg.lstsq(matrix, y[first:], rcond=None)
    model = fit_arx([u], [y], 0.05, order)
    np.testing.assert_allclose(np.array([*model.a, *model.b, model.constant]), reference, rtol=0, atol=1e-9)
    assert model.loss == pytest.approx(float(squares[0]) / (count - first), rel=1e-9)
    variance = float(squares[0]) / (count - first - reference.size)
    errors = np.sqrt(variance * np.diag(np.linalg.inv(matrix.T @ matrix)))
    np.testing.assert_allclose(model.standard_errors, errors, rtol=1e-6)


def test_a_fast_sampled_integrator_agrees_with_plain_least_squares() -> None:
    """Neighbouring samples are nearly equal: normal equations would have lost half of the digits."""
    t = 1e-3 * np.arange(20_000)
    u = np.sin(2 * np.pi * 0.7 * t) + np.sign(np.sin(2 * np.pi * 0.31 * t))
    y = 0.05 * np.cumsum(lfilter([0.1], [1.0, -0.9], u)) * 1e-3 + 1e-5 * excite(t.size, 3)
    model = fit_arx([u], [y], 1e-3, ArxOrder(3, 3, 1), "none")
    matrix = np.column_stack([-y[3 - i : -i] for i in (1, 2, 3)] + [u[3 - i : -i] for i in (1, 2, 3)])
    lengths = np.linalg.norm(matrix, axis=0)
    reference = np.linalg.lstsq(matrix / lengths, y[3:], rcond=None)[0] / lengths
    np.testing.assert_allclose(np.concatenate((model.a, model.b)), reference, rtol=1e-9)


def test_instruments_are_unbiased_where_least_squares_is_not() -> None:
    """White noise on the output is coloured in the equation of an ARX model."""
    u = excite(20_000, 1)
    clean = lfilter(np.concatenate(([0.0], B)), np.concatenate(([1.0], A)), u)
    y = clean + 0.3 * excite(u.size, 2) + 0.7
    squares = fit_arx([u], [y], 0.05, ArxOrder(3, 3, 1))
    instruments = fit_arx_instruments([u], [y], 0.05, ArxOrder(3, 3, 1))
    assert instruments.method == "instrumental variables"
    assert np.abs(squares.a - A).max() > 0.2
    found = np.concatenate((instruments.a, instruments.b))
    assert (np.abs(found - np.concatenate((A, B))) < 4.0 * instruments.standard_errors[:6]).all()
    assert instruments.standard_errors[:6].max() < 0.1
    level = instruments.constant / (1.0 + instruments.a.sum())
    assert level == pytest.approx(0.7, abs=0.02)


def test_instruments_agree_with_least_squares_without_noise() -> None:
    u = [excite(500, 1), excite(700, 2)]
    y = [system(x, 2, 0.0, 0) for x in u]
    model = fit_arx_instruments(u, y, 0.05, ArxOrder(3, 3, 2), "none")
    np.testing.assert_allclose(np.concatenate((model.a, model.b)), np.concatenate((A, B)), atol=1e-8)


def test_standard_errors_of_instruments_cover_the_truth() -> None:
    theta, claimed = [], []
    for seed in range(40):
        u = excite(1500, seed)
        clean = lfilter([0.0, 1.0, 0.5], [1.0, -1.2, 0.5], u)
        model = fit_arx_instruments([u], [clean + 0.5 * excite(1500, seed + 500)], 0.05, ArxOrder(2, 2, 1))
        theta.append(np.concatenate((model.a, model.b)))
        claimed.append(model.standard_errors[:4])
    assert np.allclose(np.mean(claimed, axis=0), np.std(theta, axis=0, ddof=1), rtol=0.4)


def test_transfer_function_and_margins_agree_with_control_and_scipy() -> None:
    u = excite(3000, 4)
    model = fit_arx([u], [system(u, 1, 0.0, 0)], 0.05, ArxOrder(3, 3, 1), "none")
    num, den = model.transfer_function()
    plant = control.tf(num, den, 0.05)
    t = 0.05 * np.arange(200)
    np.testing.assert_allclose(model.simulate(u[:200]), control.forced_response(plant, t, u[:200])[1], atol=1e-9)
    np.testing.assert_allclose(model.simulate(u[:200]), dlsim((num, den, 0.05), u[:200])[1].ravel(), atol=1e-9)
    found = sorted((p.value for p in model.poles()), key=lambda z: (z.real, z.imag))
    np.testing.assert_allclose(found, sorted(plant.poles(), key=lambda z: (z.real, z.imag)), atol=1e-9)
    padded = np.concatenate((np.zeros(den.size - num.size), num))  # freqz counts powers of 1/z
    np.testing.assert_allclose(freqz(padded, den, [0.05])[1], plant(np.exp(0.05j)), rtol=1e-9)
    truth = control.tf(np.concatenate((B, [])), np.concatenate(([1.0], A)), 0.05)
    np.testing.assert_allclose(control.margin(plant)[:2], control.margin(truth)[:2], rtol=1e-6)
