"""A plant that runs along takes no model whose arrays are laid out otherwise than its own."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from hydraulic_sim.errors import ModelError
from hydraulic_sim.live import LivePlant
from hydraulic_sim.model_file import load_model

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "user_effects" / "seal_drag.py"


def test_an_effect_file_edited_while_the_plant_runs_is_refused(tmp_path: Path) -> None:
    file = Path(shutil.copy(EXAMPLE, tmp_path))
    model = replace(load_model("sample_bench"), user_effects=(file,))
    assert "seal_drag" in model.library
    live = object.__new__(LivePlant)  # nothing needs to be compiled to be refused
    live.plant = SimpleNamespace(model=model)  # type: ignore[assignment]
    file.write_text(file.read_text() + "\n# edited\n")
    with pytest.raises(ModelError, match="edited"):
        live.replace_model(model.with_values({"moving_mass": 1.01 * model.value("moving_mass")}))
