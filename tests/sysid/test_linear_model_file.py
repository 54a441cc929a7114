"""Model files: what another program reads of them, and the way back."""

from __future__ import annotations

import json
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.signal import lfilter

from hydraulic_sysid.linear.models import (
    Arx,
    IdentificationError,
    StateSpace,
    Structure,
    TransferFunction,
    read_linear_model,
    write_linear_model,
)

DT = 0.02


def data() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(800)
    return u, lfilter([0.0, 0.02, 0.03, 0.01], np.poly([1.0, 0.8 + 0.3j, 0.8 - 0.3j]).real, u) + 0.1


@pytest.mark.parametrize("structure", [Arx(), Arx(instruments=True), TransferFunction(), StateSpace()])
def test_a_model_comes_back_as_it_was(structure: Structure, tmp_path: Path) -> None:
    u, y = data()
    y = y + 1e-3 * np.random.default_rng(1).standard_normal(u.size)
    model = structure.fit([u], [y], DT, "estimate")
    path = write_linear_model(tmp_path / "model.json", model, name="one", input={"channel": "drive", "unit": "V"})
    again, content = read_linear_model(path)
    assert type(again) is type(model)
    assert list(content)[:3] == ["format", "name", "input"] and content["input"]["unit"] == "V"
    np.testing.assert_array_equal(again.simulate(u, y), model.simulate(u, y))
    np.testing.assert_array_equal(again.predict(u, y), model.predict(u, y))
    assert again.parameters == model.parameters


@pytest.mark.parametrize("structure", [Arx(), TransferFunction(), StateSpace()])
def test_another_program_needs_three_lines(structure: Structure, tmp_path: Path) -> None:
    """The file's transfer function, by `control`, moves as the model does."""
    u, y = data()
    model = structure.fit([u], [y], DT, "none")
    content = json.loads(write_linear_model(tmp_path / "model.json", model).read_text())
    dt = content["sampling_time"] if content["domain"] == "discrete" else 0.0
    plant = control.tf(content["numerator"], content["denominator"], dt)
    if dt == 0.0:
        plant = control.c2d(control.ss(plant), DT)
    response = control.forced_response(plant, DT * np.arange(u.size), u)[1]
    np.testing.assert_allclose(response, model.simulate(u), atol=1e-6 * np.ptp(y))


def test_nothing_else_is_written_over_or_read(tmp_path: Path) -> None:
    u, y = data()
    model = Arx().fit([u], [y], DT, "none")
    path = tmp_path / "model.json"
    for text, word in (("{}", "format is None"), ("[1", "not a JSON"), ('{"format": "else"}', "'else'")):
        path.write_text(text)
        with pytest.raises(IdentificationError, match=word):
            write_linear_model(path, model)
        with pytest.raises(IdentificationError, match=word):
            read_linear_model(path)
        assert path.read_text() == text
    path.unlink()
    with pytest.raises(IdentificationError, match="cannot be read"):
        read_linear_model(path)
    content = json.loads(write_linear_model(path, model).read_text())
    del content["estimate"]["a"]
    path.write_text(json.dumps(content))
    with pytest.raises(IdentificationError, match="not a complete model"):
        read_linear_model(path)
