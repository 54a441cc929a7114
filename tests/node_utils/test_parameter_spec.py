from __future__ import annotations

import math

import pytest

from hydraulic_node_utils.parameter_spec import ParameterError, ParameterSpec

RATE = ParameterSpec("rate", 1000.0, "sampling rate", "Hz", 1.0, 5000.0)


def test_an_integer_is_a_float_where_a_float_is_meant() -> None:
    value = RATE.check(500)
    assert value == 500.0 and type(value) is float


@pytest.mark.parametrize("value", [0.5, 5000.1, math.nan, math.inf])
def test_range_is_named(value: float) -> None:
    with pytest.raises(ParameterError, match=r"rate is .* Hz, must be within 1 … 5000 Hz"):
        RATE.check(value)


@pytest.mark.parametrize("value", ["fast", True, None])
def test_type_is_named(value: object) -> None:
    with pytest.raises(ParameterError, match=r"rate is .*, must be of type float"):
        RATE.check(value)


def test_unbounded_ends_and_other_types() -> None:
    assert ParameterSpec("n", 3, "count", minimum=0).check(10**9) == 10**9
    with pytest.raises(ParameterError, match="n is -1"):
        ParameterSpec("n", 3, "count", minimum=0).check(-1)
    assert ParameterSpec("on", False, "switch").check(True) is True
    assert ParameterSpec("model", "", "file").check("x.yaml") == "x.yaml"
    with pytest.raises(ParameterError, match="bool"):
        ParameterSpec("on", False, "switch").check(1)


def test_only_a_choice_is_taken() -> None:
    spec = ParameterSpec("law", "pid", "of control", choices=("pid", "npid"))
    assert spec.check("npid") == "npid"
    with pytest.raises(ParameterError, match="law is 'lqr'; allowed are pid, npid"):
        spec.check("lqr")
