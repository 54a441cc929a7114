"""Order selection finds the order that made the data, and compares all orders on the same samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_sysid.estimation import metrics
from hydraulic_sysid.linear.models import (
    CRITERIA,
    Arx,
    ArxOrder,
    IdentificationError,
    StateSpace,
    TransferFunction,
    TransferFunctionOrder,
    best,
    try_orders,
)
from hydraulic_sysid.linear.models.order_selection import information_criteria
from hydraulic_sysid.linear.models.structures import fit_on_equal_samples

DEN, NUM = [1.0, -1.5, 0.7], [0.0, 0.0, 1.0, 0.5]


def arx_data(n: int = 3000, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    u, e = np.random.default_rng(seed).standard_normal((2, n))
    return u, lfilter(NUM, DEN, u) + lfilter([1.0], DEN, 0.3 * e)


def test_every_criterion_finds_the_orders_and_the_dead_time() -> None:
    u, y = arx_data()
    candidates = try_orders(Arx(ArxOrder(4, 4, 3)).up_to(), [u], [y], 1.0, "none")
    assert len(candidates) == 4 * 4 * 3
    assert best(candidates, "bic").structure.text == "ARX(2, 2, 2)"
    for criterion in CRITERIA:
        order = best(candidates, criterion).structure.order
        # A dead time shorter by one needs one more coefficient for the same model.
        assert order.na >= 2 and order.nk <= 2 <= order.nk + order.nb - 1
    by_aic, by_bic = (best(candidates, c).parameters for c in ("aic", "bic"))
    assert by_bic <= by_aic


def test_criteria_worked_by_hand() -> None:
    assert information_criteria(np.e, 3, 100) == pytest.approx((100.0 + 6.0, 100.0 + 3.0 * np.log(100.0)))
    u, y = arx_data(500)
    (only,) = try_orders([Arx(ArxOrder(2, 2, 2))], [u], [y], 1.0, "none")
    model = Arx(ArxOrder(2, 2, 2)).fit([u], [y], 1.0, "none")
    assert only.loss == model.loss and only.fpe == metrics.fpe(model.loss, 4, 500 - 3)
    assert only.aic == pytest.approx(497 * np.log(model.loss) + 8.0)


def test_all_orders_are_compared_on_the_same_samples() -> None:
    """A huge first output, which only orders of short memory would have to predict."""
    u, y = arx_data(400)
    y[:3] = 50.0
    losses = [fit_on_equal_samples(Arx(ArxOrder(n, 1, 1)), [u], [y], 1.0, "none", 5).samples for n in (1, 3, 5)]
    assert losses == [395, 395, 395]


def test_cross_validation_is_the_free_run_error_on_the_parts_left_out() -> None:
    u, y = arx_data(400)
    structure = Arx(ArxOrder(2, 2, 2))
    (only,) = try_orders([structure], [u], [y], 1.0, "none")
    squares = 0.0
    for part in range(4):
        inside = slice(100 * part, 100 * (part + 1))
        rest = [(u[: inside.start], y[: inside.start]), (u[inside.stop :], y[inside.stop :])]
        rest = [(a, b) for a, b in rest if a.size]
        model = structure.fit([a for a, _ in rest], [b for _, b in rest], 1.0, "none")
        squares += np.sum((y[inside] - model.simulate(u[inside], y[inside])) ** 2)
    assert only.cv == pytest.approx(squares / 400.0, rel=1e-9)


def test_transfer_functions_and_state_spaces_are_chosen_alike() -> None:
    rng = np.random.default_rng(1)
    u = np.repeat(rng.standard_normal(120), 5)
    clean = lfilter([0.0, 0.02, 0.015], np.poly([0.9, 0.7]), u)
    y = clean + 0.01 * rng.standard_normal(u.size)
    found = best(try_orders(StateSpace(3).up_to(), [u], [y], 1.0, "estimate"), "bic").structure
    assert found.states == 2
    candidates = try_orders(TransferFunction(TransferFunctionOrder(3, 0)).up_to(), [u], [y], 1.0, "estimate")
    assert {c.structure.text for c in candidates} >= {"first-order transfer function", "third-order transfer function"}
    assert best(candidates, "bic").structure.order.poles == 2


def test_what_cannot_be_chosen_says_why() -> None:
    u, y = arx_data(200)
    with pytest.raises(IdentificationError, match="none of fpe, aic, bic, cv"):
        best(try_orders([Arx()], [u], [y], 1.0, "none"), "luck")
    with pytest.raises(IdentificationError, match="zero throughout"):
        try_orders(Arx().up_to(), [np.zeros(200)], [y], 1.0, "none")
