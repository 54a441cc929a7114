"""A plan on the model before the bench; and what a search tells while it goes on."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.diagnosis.rehearsal import rehearse
from hydraulic_sysid.diagnosis.search.candidate_table import NOTHING, UNKNOWN, probabilities
from hydraulic_sysid.diagnosis.search.misfit import Misfit
from hydraulic_sysid.diagnosis.search.unknown_law import probability_of_unknown
from hydraulic_sysid.excitation import Plan, load_plan
from hydraulic_sysid.verbs import rehearse as verb

MODEL = "moog_mcr_m_1002_bench"


@pytest.fixture(scope="module")
def plan() -> Plan:
    steps = load_plan("steps")
    return replace(steps, signal=replace(steps.signal, levels=(1.0, -1.0, 3.0, -3.0)), duration=2.0)


def checks(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {check["name"]: check for check in document["checks"]}


def test_a_plan_that_keeps_its_limits_may_be_played(plan: Plan) -> None:
    found = plain(rehearse(plan, load_model(MODEL)))
    assert found["verdict"]["go"] and all(check["good"] for check in found["checks"])
    assert 0.0 < checks(found)["travel"]["used"] < 1.0 and checks(found)["identifiability"]["used"] > 0.0
    low, high = found["limits"]["travel"]
    position = found["traces"]["position"]["value"]
    assert low < min(position) and max(position) < high
    json.dumps(found, allow_nan=False)


@pytest.mark.parametrize(
    ("change", "position", "name"),
    [
        ({"travel_limit": 0.005}, None, "completes"),
        ({"centre": 0.7, "travel_limit": 0.6}, None, "travel"),
        ({}, 0.7, "completes"),
    ],
)
def test_one_that_does_not_may_not(plan: Plan, change: dict[str, Any], position: float | None, name: str) -> None:
    found = rehearse(replace(plan, **change), load_model(MODEL), position)
    assert not found["verdict"]["go"] and not checks(found)[name]["good"]
    assert "identifiability" not in checks(found), "it is not asked what a record tells that must not be made"


def test_the_verb_says_by_its_exit_code_whether_it_may_be_played(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    line = ["triangle", "--model", MODEL, "--out"]
    assert verb.main([*line, str(tmp_path / "a"), "--progress"]) == 0
    told = [json.loads(text) for text in capsys.readouterr().err.splitlines()]
    assert [t["progress"] for t in told][-1] == "writing the report" and len(told) > 2
    assert verb.main([*line, str(tmp_path / "b"), "--position", "0.74"]) == 1
    assert "broken off" in capsys.readouterr().out
    assert (tmp_path / "b" / "report.html").is_file()


def misfit(total: float, count: int = 20_000) -> Misfit:
    return Misfit(0.6 * total, 0.4 * total, int(0.6 * count), int(0.4 * count))


def test_probabilities_weigh_what_is_left_against_parameters() -> None:
    base = misfit(20_500.0)
    found = probabilities(base, [("good", 1, misfit(20_000.0)), ("as_good", 1, misfit(20_000.5)), ("poor", 2, base)])
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["good"] / found["as_good"] == pytest.approx(20.0 ** (0.5 / 30.0), rel=1e-6)
    assert found["good"] + found["as_good"] == pytest.approx(1.0 - found[UNKNOWN], abs=1e-3)
    assert found["poor"] == found[NOTHING] == pytest.approx(found["good"] / 8e3, 0.1)
    assert found[UNKNOWN] == pytest.approx(probability_of_unknown(base, misfit(20_000.0)), rel=1e-9)
    lacking = probabilities(base, [("half", 1, misfit(20_250.0))])
    assert lacking[UNKNOWN] > found[UNKNOWN], "more is left"
    alone = probabilities(misfit(20_000.0), [("nothing_gained", 1, misfit(20_000.0))])
    known = 1.0 - alone[UNKNOWN]
    assert alone[NOTHING] == pytest.approx(known / (1.0 + 20.0 ** (-np.log(20_000) / 30.0)), rel=1e-6)
