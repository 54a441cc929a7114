"""The verb `effects`: the library as a table, one effect whole, and as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hydraulic_sim.registry import library
from hydraulic_sim.verbs import effects

SEAL_DRAG = Path(__file__).parents[2] / "examples/user_effects/seal_drag.py"


def test_json_holds_every_effect_with_all_that_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert effects.main(["--json"]) == 0
    records = {r["name"]: r for r in json.loads(capsys.readouterr().out)}
    found = library()
    assert set(records) == set(found)
    for name, record in records.items():
        assert record["equation"] == found[name].equation
        assert [p["name"] for p in record["parameters"]] == [p.name for p in found[name].parameters]
        assert all(p["unit"] and p["source"] for p in record["parameters"])
        assert {"slot", "source", "excited_by", "confused_with"} <= set(record)


def test_table_and_single_effect(capsys: pytest.CaptureFixture[str]) -> None:
    assert effects.main([]) == 0
    table = capsys.readouterr().out
    assert all(name in table for name in library())
    assert effects.main(["seal_drag", "--file", str(SEAL_DRAG)]) == 0
    assert str(SEAL_DRAG.name) in capsys.readouterr().out.replace("\n", "")


def test_unknown_effect_is_one_line_with_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert effects.main(["stiction"]) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert "'stiction'" in errors and "stribeck_friction" in errors
