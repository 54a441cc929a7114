"""Text with a unit to SI, and nothing taken for a quantity that is none."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_sim import base
from hydraulic_sim.errors import ModelError
from hydraulic_sim.model_document import quantity
from hydraulic_sim.registry import library
from hydraulic_sim.units import EVERYDAY, conversion, to_si

FINITE = st.floats(allow_nan=False, allow_infinity=False)
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
PARAMETERS = [*base.PARAMETERS, *(p for e in library().values() for p in e.parameters)]


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("12.5 in^2", "m^2", 12.5 * 0.0254**2),
        ("22e4 psi", "Pa", 22e4 * 6894.757293168361),
        ("60 in", "m", 1.524),
        ("40 gal/min", "m^3/s", 40 * 3.785411784e-3 / 60),
        ("150 l/min", "m^3/s", 2.5e-3),
        ("210 bar", "Pa", 2.1e7),
        ("5 %", "1", 0.05),
        ("0.05", "1", 0.05),
        ("500", "kg", 500.0),
        ("4 ms", "s", 4e-3),
        ("3 kN/mm", "N/m", 3e6),
        ("45 deg", "rad", math.pi / 4),
        ("1.2 l/(min*bar^0.5)", "m^3/(s*Pa^0.5)", 1.2e-3 / 60 / math.sqrt(1e5)),
        ("60 1/min", "1/s", 1.0),
        ("2 kHz", "Hz", 2000.0),
        ("  -3e-2\tmm ", "m", -3e-5),
        (7, "kg", 7.0),
    ],
)
def test_units_of_the_field(text: str | float, unit: str, expected: float) -> None:
    assert to_si(text, unit) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "unit", "says"),
    [
        ("5 m", "kg", "'5 m' is in meter, which does not convert to kg"),
        ("3 m", "1", "does not convert to 1"),
        ("", "kg", "'' is not a quantity; expected for example '1.5 kg'"),
        ("kg", "kg", "not a quantity"),
        ("1,5 kg", "kg", "not a quantity"),
        ("1_000 kg", "kg", "not a quantity"),
        ("1 000 kg", "kg", "not a quantity"),
        ("3 m + 2 m", "m", "not a quantity"),
        ("[1, 2] m", "m", "not a quantity"),
        ("about 3 m", "m", "not a quantity"),
        ("2**3 m", "m", "not a quantity"),
        ("3 furlongz", "m", "not a quantity"),
        ("__import__('os')", "m", "not a quantity"),
        ("500 rad/s", "Hz", "counts angles"),
        ("60 rpm", "Hz", "counts angles"),
        ("nan kg", "kg", "not a quantity"),
        ("1e999 kg", "kg", "not finite"),
        (float("nan"), "kg", "not finite"),
        (float("inf"), "kg", "not finite"),
        (True, "1", "True is not a number"),
        (None, "kg", "None is not a number"),
        ([1.0], "kg", "is not a number"),
    ],
)
def test_what_is_no_quantity_is_refused_with_place_and_value(value: object, unit: str, says: str) -> None:
    with pytest.raises(ModelError, match="^mass: ") as caught:
        to_si(value, unit, "mass")  # type: ignore[arg-type]
    assert says in str(caught.value)


@settings(max_examples=200, deadline=None)
@given(number=FINITE, parameter=st.sampled_from(PARAMETERS))
def test_what_is_written_is_read_again_to_the_last_digit(number: float, parameter: base.Parameter) -> None:
    assert to_si(quantity(number, parameter), parameter.unit) == number


@settings(max_examples=100, deadline=None)
@given(
    number=st.floats(-1e6, 1e6),
    unit=st.sampled_from(
        [("psi", "Pa"), ("in^2", "m^2"), ("l/min", "m^3/s"), ("lbf", "N"), ("ms", "s"), ("degF", "K")]
    ),
)
def test_units_convert_linearly_and_back(number: float, unit: tuple[str, str]) -> None:
    own, si = unit
    factor, offset = conversion(own, si)
    value = to_si(f"{number!r} {own}", si)
    assert value == pytest.approx(factor * number + offset, rel=1e-9, abs=1e-9 * abs(offset) + 1e-300)
    back, shift = conversion(si, own)
    assert back * value + shift == pytest.approx(number, rel=1e-6, abs=1e-9 * abs(shift) + 1e-9)


@settings(max_examples=150, deadline=None)
@given(text=st.text(max_size=20))
def test_any_text_is_a_finite_number_or_a_clear_error(text: str) -> None:
    try:
        assert math.isfinite(to_si(text, "Pa", "key"))
    except ModelError as error:
        assert str(error).startswith("key: ")


def test_an_unknown_unit_of_a_column_is_refused() -> None:
    with pytest.raises(ModelError, match="unit 'furlongz' does not convert to m"):
        conversion("furlongz", "m")
    with pytest.raises(ModelError, match="unit 'kg' does not convert to m"):
        conversion("kg", "m", "column x")


@pytest.fixture(scope="module")
def registry() -> pint.UnitRegistry:
    return pint.UnitRegistry()


@pytest.mark.parametrize(("own", "unit"), EVERYDAY)
@given(number=st.floats(-1e9, 1e9))
def test_what_is_converted_without_pint_is_what_pint_says(registry, own: str, unit: str, number: float) -> None:
    assert to_si(f"{number!r} {own}", unit) == registry.Quantity(number, own).to(unit).magnitude


def test_a_model_file_is_read_without_pint() -> None:
    """It takes longer to load than all else that a node needs."""
    code = "import sys, hydraulic_sim.model_file as file; [file.load_model(p) for p in file.presets()]"
    subprocess.run([sys.executable, "-c", f"{code}; assert 'pint' not in sys.modules"], check=True, env=ENVIRONMENT)
