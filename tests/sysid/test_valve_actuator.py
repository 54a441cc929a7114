"""The smallest nonlinear actuator: its valve curve recovered, better than a line where there is a curve."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.models import IdentificationError, fit_transfer_function
from hydraulic_sysid.linear.models.transfer_function import TransferFunctionOrder
from valve_actuator import fit_valve_actuator

SUPPLY, COUPLING, LEAKAGE, DAMPING = 3.0, 0.06, 0.02, 0.12


def flow(u: float) -> float:
    """A dead zone, and a gain that differs by direction."""
    return (1.6 if u > 0 else 0.8) * np.sign(u) * max(abs(u) - 0.25, 0.0)


def truth(u: np.ndarray, start: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """By another solver, restarted at every sample because the drive is held."""
    state, out = np.array(start), []
    for volts in u:
        out.append(state[0])
        q = flow(float(volts))

        def rate(_: float, x: np.ndarray, q: float = q) -> list[float]:
            drop = 1.0 - np.sign(q) * x[0] / SUPPLY
            inflow = q * np.sign(drop) * np.sqrt(abs(drop))
            return [inflow - COUPLING * x[1] - LEAKAGE * x[0], x[0] - DAMPING * x[1]]

        state = solve_ivp(rate, (0.0, 1.0), state, rtol=1e-8, atol=1e-10).y[:, -1]
    return np.array(out)


@pytest.fixture(scope="module")
def data() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-1.2, 1.2, 50), 12)
    return u, truth(u) + 0.01 * rng.standard_normal(u.size)


def test_curve_and_dynamics_are_recovered_and_fresh_data_foreseen(data: tuple[np.ndarray, np.ndarray]) -> None:
    u, y = data
    model = fit_valve_actuator([u[:400]], [y[:400]], 1.0, knots=(9,))
    assert model.coupling == pytest.approx(COUPLING, rel=0.1)
    assert model.damping == pytest.approx(DAMPING, rel=0.2)
    assert model.supply == pytest.approx(SUPPLY, rel=0.1)
    for volts in (-1.0, 1.0):
        assert np.interp(volts, model.knots, model.curve) == pytest.approx(flow(volts), rel=0.1)
    linear = fit_transfer_function([u[:400]], [y[:400]], 1.0, TransferFunctionOrder(3, 2))
    fits = [metrics.best_fit(y[400:], m.simulate(u[400:], y[400:])) for m in (model, linear)]
    assert fits[0] > 93.0 > 85.0 > fits[1]


def test_the_number_of_knots_is_chosen_by_what_they_earn(data: tuple[np.ndarray, np.ndarray]) -> None:
    u, y = data
    chosen = fit_valve_actuator([u[:300]], [y[:300]], 1.0, knots=(3, 9))
    alone = {count: fit_valve_actuator([u[:300]], [y[:300]], 1.0, knots=(count,)).bic for count in (3, 9)}
    assert chosen.bic == min(alone.values()) == alone[chosen.knots.size]
    assert chosen.parameters == chosen.knots.size + 4


def test_several_experiments_and_their_initial_states() -> None:
    rng = np.random.default_rng(1)
    us = [np.repeat(rng.uniform(-1.2, 1.2, 15), 10) for _ in range(2)]
    ys = [truth(u, start) for u, start in zip(us, ((1.0, 0.0), (-0.5, 5.0)), strict=True)]
    model = fit_valve_actuator(us, ys, 1.0, knots=(9,))
    for u, y in zip(us, ys, strict=True):
        assert metrics.best_fit(y, model.simulate(u, y)) > 92.0


def test_data_that_do_not_move_are_refused() -> None:
    with pytest.raises(IdentificationError, match="must move"):
        fit_valve_actuator([np.ones(200)], [np.arange(200.0)], 1.0)
