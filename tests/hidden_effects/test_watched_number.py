"""A constant that is watched decides as the number it stands for does, and notes what others would decide."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from hidden_effects.watched_number import Label, WatchedNumber
from hydraulic_sysid.diagnosis.search.criteria import Criteria

HALF, DOUBLE = ("constant", "half"), ("constant", "double")


@pytest.fixture
def noted() -> set[Label]:
    return set()


@pytest.fixture
def lost() -> set[Label]:
    return set()


@pytest.fixture
def watched(noted: set[Label], lost: set[Label]) -> WatchedNumber:
    return WatchedNumber(2.0, {HALF: 1.0, DOUBLE: 4.0}, noted, lost)


@pytest.mark.parametrize(
    ("number", "above", "others"),
    [(0.5, False, set()), (1.5, False, {HALF}), (3.0, True, {DOUBLE}), (5.0, True, set())],
)
def test_a_comparison_notes_whose_answer_is_another(
    watched: WatchedNumber, noted: set[Label], number: float, above: bool, others: set[Label]
) -> None:
    assert (number > watched) is above and noted == others
    assert (np.float64(number) > watched) == above and noted == others


def test_arithmetic_goes_on_with_all_that_it_might_be(
    watched: WatchedNumber, noted: set[Label], lost: set[Label]
) -> None:
    scaled = 3.0 * watched**2 - np.float64(1.0)
    assert (scaled.value, scaled.others) == (11.0, {HALF: 2.0, DOUBLE: 47.0})
    assert max(scaled, 5.0) is scaled and noted == {HALF}
    assert (scaled - scaled).others == {HALF: 0.0, DOUBLE: 0.0}
    assert (-watched).value == -2.0 and not lost


def test_arrays_are_compared_element_by_element(watched: WatchedNumber, noted: set[Label]) -> None:
    assert (np.array([0.5, 5.0]) > watched).tolist() == [False, True] and not noted
    assert (np.array([0.5, 3.0]) > watched).tolist() == [False, True] and noted == {DOUBLE}


def test_where_it_becomes_a_plain_number_nothing_is_known(watched: WatchedNumber, lost: set[Label]) -> None:
    assert float(watched) == 2.0 and lost == {HALF, DOUBLE}
    lost.clear()
    assert (np.array([4.0]) / watched).tolist() == [2.0] and lost == {HALF, DOUBLE}


@pytest.mark.parametrize("name", [f.name for f in fields(Criteria)])
def test_every_constant_of_the_search_says_what_it_is(name: str) -> None:
    own = next(f for f in fields(Criteria) if f.name == name)
    assert all(own.metadata[word] for word in ("unit", "reason", "half", "double"))
