"""Whether segments agree on an effect, whatever the noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.diagnosis.search.agreement import agreed, agreement, sure
from hydraulic_sysid.diagnosis.search.criteria import CRITERIA
from hydraulic_sysid.diagnosis.search.fitting import Fitting
from hydraulic_sysid.diagnosis.search.misfit import Misfit

SEGMENTS, SAMPLES = 90, 400
FIT = np.arange(SEGMENTS) % 3 != 2


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(SEGMENTS, SAMPLES))


@pytest.mark.parametrize("acting", [SEGMENTS, 9], ids=["everywhere", "in a tenth of the segments"])
def test_what_is_there_is_agreed_upon_however_few_segments_show_it(acting: int) -> None:
    noise, law = white(1), 0.25 * np.sin(0.1 * np.arange(SAMPLES))
    shown = (np.arange(SEGMENTS) < acting)[:, None] * law
    assert agreed([noise + shown], [noise], [FIT])


def test_what_each_segment_says_otherwise_is_not() -> None:
    """Coloured noise that is taken for white: by its likelihood the change is sure, between segments it is none."""
    slow = np.repeat(np.random.default_rng(2).normal(size=(SEGMENTS, 1)), SAMPLES, axis=1)
    noise = white(3) + slow
    shape = np.ones((SEGMENTS, SAMPLES))
    change = float(np.sum(noise[FIT] * shape[FIT]) / np.sum(shape[FIT] ** 2)) * shape
    gain = float(np.sum(noise[FIT] ** 2) - np.sum((noise - change)[FIT] ** 2))
    assert gain > CRITERIA.agreed, "white noise would make it sure"
    assert not agreed([noise], [noise - change], [FIT])


def test_on_white_noise_it_is_the_reduction_of_the_sum_of_squares() -> None:
    noise, shape = white(4), 0.1 * np.ones((SEGMENTS, SAMPLES))
    residual = noise + shape
    own, size = np.sum(shape * residual, axis=1), np.sum(shape**2, axis=1)
    assert agreement(own, size) == pytest.approx(own.sum() ** 2 / size.sum(), rel=0.3)


def test_nothing_changed_is_nothing() -> None:
    noise = white(5)
    assert not agreed([noise], [noise], [FIT])


def test_what_only_fits_the_fitted_segments_is_chance() -> None:
    noise = white(6)
    after = noise.copy()
    after[FIT] *= 0.9
    after[~FIT] *= 1.1
    assert not agreed([noise], [after], [FIT])


def test_what_was_not_chosen_need_not_stand_out_among_many() -> None:
    noise, shape = white(7), np.sin(0.1 * np.arange(SAMPLES)) * np.ones((SEGMENTS, 1))
    change = 0.07 * shape
    own, size = np.sum(change * (noise + change), axis=1), np.sum(change**2, axis=1)
    assert 2.0 * CRITERIA.confirmed < agreement(own[FIT], size[FIT]) < CRITERIA.agreed
    assert not agreed([noise + change], [noise], [FIT])
    assert sure(own, size, FIT, found=False)


@pytest.mark.parametrize(("scatter", "believed"), [(10.0, True), (200.0, False)], ids=["steady", "by chance"])
def test_a_step_that_the_records_show_is_judged_by_what_segments_gain(scatter: float, believed: bool) -> None:
    """Rounding is no direction in which a share of it could be there: where it is a step off its change is large."""
    model = load_model("sample_bench")

    def state(model: Model, gains: np.ndarray) -> Any:
        squares, counted = SAMPLES - gains, np.full(SEGMENTS, float(SAMPLES))
        fit, rest = float(squares[FIT].sum()), float(squares[~FIT].sum())
        values = (SAMPLES * int(FIT.sum()), SAMPLES * int((~FIT).sum()))
        left = Misfit(fit, rest, *values, typical=1.0, by_segment=squares, counted=counted, fitted=FIT)
        return SimpleNamespace(model=model, misfit=left, residual=[])

    gains = np.random.default_rng(8).normal(20.0, scatter, SEGMENTS)
    before, after = state(model, np.zeros(SEGMENTS)), state(model.with_effect("sensor_quantisation"), gains)
    assert Fitting.better(cast(Any, None), before, after) is believed
