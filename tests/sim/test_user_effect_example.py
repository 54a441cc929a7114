"""The worked example of docs/user-effects.md: an effect outside the packages is like a built-in one."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import Plant

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples/user_effects/bench_with_seal_drag.yaml"
KEY = "seal_drag.drag_a"


@pytest.fixture(scope="module")
def model():
    return replace(load_model(EXAMPLE), lean=True)  # compiled in a fraction of the time


def test_its_parameters_are_in_the_model_and_free_for_a_fit(model):
    assert KEY in set(model.keys())
    assert KEY in model.free_keys()
    assert model.value(KEY) == pytest.approx(1.5e-5)
    assert model.entry(KEY).bounds == (0.0, 1e-3)


def test_it_acts_in_the_plant_and_is_nothing_at_its_null_value(model):
    t = np.arange(2000) * 1e-3
    drive = 2.0 * np.sin(2 * np.pi * 0.7 * t)
    with_drag = Plant(model).simulate(drive, 1e-3)
    null = Plant(model).with_parameters({KEY: 0.0, "seal_drag.drag_b": 0.0}).simulate(drive, 1e-3)
    without = Plant(model.without_effect("seal_drag")).simulate(drive, 1e-3)
    assert np.array_equal(null.force, without.force)
    moving = np.abs(without.velocity) > 0.05
    extra = (with_drag.force - without.force)[moving] * np.sign(without.velocity[moving])
    # At a mean of some 7 MPa in both chambers the seals drag with about 1.5e-5 m² · 14 MPa = 210 N.
    assert np.median(extra) == pytest.approx(210.0, rel=0.15)


def test_it_is_saved_and_read_again(model, tmp_path):
    path = save_model(model.with_values({KEY: 2e-5}), tmp_path / "changed.yaml")
    again = load_model(path)
    assert again.value(KEY) == 2e-5
    assert again.user_effects == model.user_effects


@pytest.mark.thorough
def test_it_is_a_ros_parameter_of_the_simulator(launch, client, wait_until):
    Plant(load_model(EXAMPLE))  # compiled before the node starts
    launch("hydraulic_sim.nodes.simulator", "--autostart", "--ros-args", "-p", f"model:={EXAMPLE}")
    wait_until(lambda: client.state() == "active", "the plant to be active")
    answer = client.call(
        "rcl_interfaces/srv/DescribeParameters", "/actuator/plant/describe_parameters", names=[f"model.{KEY}"]
    )
    (described,) = answer.descriptors
    assert "m^2" in described.description
    assert described.floating_point_range[0].to_value == pytest.approx(1e-3)


def test_the_documents_commands_name_files_that_exist():
    text = (ROOT / "docs/user-effects.md").read_text(encoding="utf-8")
    named = set(re.findall(r"examples/\S+?\.(?:py|yaml)", text))
    assert named
    assert all((ROOT / name).is_file() for name in named)
