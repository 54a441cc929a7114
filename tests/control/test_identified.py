"""Identified models as plants: exact at their own instants, critical points against closed forms."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_control.controller import Controller
from hydraulic_control.errors import ControlError
from hydraulic_control.identified import IdentifiedModel, from_coefficients, load_identified
from hydraulic_control.margins import critical_of_identified, critical_of_model, critical_point, grid
from hydraulic_control.simulation import run, step_reference
from hydraulic_sim.linear import closed_form
from hydraulic_sim.model_file import load_model

NUMERATOR, PERIOD = [0.00185, 0.00153, 0.00058], 0.05
DENOMINATOR = np.poly([1.0, -0.28 + 0.43j, -0.28 - 0.43j]).real


def played(model: IdentifiedModel, drive: np.ndarray, dt: float = 1e-3) -> np.ndarray:
    """Positions [m] (N,) of the open loop under a drive [V] (N,) that is held over each sample, from rest."""
    late = np.concatenate((np.zeros(round(model.delay / dt)), drive))[: len(drive)]
    position = model.direct * late
    for p, c in zip(model.poles, model.residues, strict=True):
        push = np.expm1(p * dt) / p if abs(p) * dt > 1e-9 else dt
        position = position + (c * lfilter([0.0, push], [1.0, -np.exp(p * dt)], late)).real
    return position


@pytest.mark.parametrize("den", [DENOMINATOR, np.poly([1.0, -0.4, 0.2]), np.poly([0.9, 0.0, 0.5])], ids=str)
def test_a_sampled_model_answers_as_its_difference_equation(den: np.ndarray) -> None:
    drive = np.random.default_rng(0).standard_normal(60)
    found = played(from_coefficients(NUMERATOR, den, PERIOD), np.repeat(drive, 50))[::50]
    delayed = np.concatenate((np.zeros(len(den) - len(NUMERATOR)), NUMERATOR))
    assert found == pytest.approx(lfilter(delayed, den, drive), abs=1e-10)


def test_a_continuous_model_and_its_delay() -> None:
    x = played(from_coefficients([2.0], [1.0, 4.0], None, delay=0.01), np.ones(500))
    t = 1e-3 * np.arange(500)
    assert x == pytest.approx(np.where(t > 0.01, 0.5 * (1.0 - np.exp(-4.0 * (t - 0.01))), 0.0), abs=1e-9)


def test_the_drive_of_a_loop_is_late_by_the_delay() -> None:
    model = from_coefficients([2.0], [1.0, 4.0], None, delay=0.01)
    law, reference = Controller({"kp": 5.0}), step_reference(0.1)
    compiled = run(model, law, reference, 0.5)
    law.stop()
    drives = np.zeros(501)
    for i in range(500):
        drives[i + 1] = law.step(1e-3, *reference(1e-3 * i), played(model, drives[: i + 1])[-1])
    assert compiled.position == pytest.approx(played(model, drives[:500]), abs=1e-12)
    assert compiled.drive == pytest.approx(drives[:500], abs=1e-12)


def test_the_frequency_response_is_the_transfer_functions() -> None:
    model = from_coefficients([3.0, 1.0], [1.0, 0.5, 9.0], None, delay=0.02)
    s = 1j * np.array([0.1, 1.0, 3.0, 20.0])
    assert model.response(s.imag) == pytest.approx((3.0 * s + 1.0) / (s**2 + 0.5 * s + 9.0) * np.exp(-0.02 * s))
    assert from_coefficients([0.04], [1.0, 0.0], None).velocity_gain == pytest.approx(0.04)


def test_the_critical_point_of_an_integrator_with_dead_time() -> None:
    """K/s·exp(−sτ) oscillates at ω = π/(2τ) with the gain ω/K."""
    omega, late = grid(), 0.01
    point = critical_point(omega, 0.04 / (1j * omega), late)
    assert point is not None
    assert point.period == pytest.approx(4.0 * late, rel=1e-4)
    assert point.gain == pytest.approx(math.pi / (2.0 * late) / 0.04, rel=1e-4)


def test_the_critical_point_of_the_third_order_form() -> None:
    """Merritt (1967), ch. 6: K_v = 2·ζ·ω, at the natural frequency, where spool and loop are fast."""
    form = closed_form(load_model("moog_mcr_m_1002_bench"))
    omega = grid()
    point = critical_point(omega, form.transfer_function()(1j * omega), 0.0)
    assert point is not None
    assert point.gain * form.velocity_gain == pytest.approx(2.0 * form.damping * form.natural_frequency, rel=1e-2)
    assert point.period == pytest.approx(2.0 * math.pi / form.natural_frequency, rel=1e-2)


def test_the_critical_point_of_the_plant_lies_near_its_resonance() -> None:
    model = load_model("moog_mcr_m_1002_bench")
    point = critical_of_model(model)
    assert point is not None
    assert 2.0 * math.pi / point.period == pytest.approx(closed_form(model).natural_frequency, rel=0.1)


def test_a_slow_model_says_that_it_cannot_tell() -> None:
    assert critical_of_identified(from_coefficients(NUMERATOR, DENOMINATOR, PERIOD)) is None


def test_files(tmp_path: Path) -> None:
    folder = tmp_path / "my-chirp"
    folder.mkdir()
    form = {"numerator": NUMERATOR, "denominator": DENOMINATOR.tolist(), "sampling_time": PERIOD, "domain": "discrete"}
    units = {"input": {"unit": "V"}, "output": {"unit": "m"}}
    flat, nested = folder / "linear_model.json", folder / "identify.json"
    flat.write_text(json.dumps({**form, **units}))
    nested.write_text(json.dumps({"settings": units, "model": {"transfer_function": form}}))
    for file in (flat, nested):
        model = load_identified(file)
        assert (model.name, model.highest) == ("my-chirp", pytest.approx(math.pi / PERIOD))
    flat.write_text(json.dumps({**form, "domain": "continuous", "sampling_time": 1e-3}))
    assert load_identified(flat).highest == math.inf
    for text, complaint in (
        ("{", "not a JSON"),
        ("[]", "no transfer function"),
        ('{"numerator": [1]}', "no transfer function"),
        (json.dumps({**form, "output": {"unit": "Pa"}}), "output is in Pa"),
        (json.dumps({**form, "numerator": [1, 2, 3, 4, 5]}), "no proper"),
        (json.dumps({**form, "denominator": [1.0, -2.0, 1.0], "numerator": [1.0]}), "repeated"),
        (json.dumps({**form, "delay": -1}), "delay"),
        (json.dumps({**form, "sampling_time": -0.1}), "sampling time"),
    ):
        flat.write_text(text)
        with pytest.raises(ControlError, match=complaint):
            load_identified(flat)
    with pytest.raises(ControlError, match="cannot be read"):
        load_identified(tmp_path / "none.json")
