"""The grey box: what is left is separated into noise, what physics does not name, and what nothing tells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data import results
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.grey_box import GreyBoxError, grey_box
from hydraulic_sysid.diagnosis.grey_box.selection import select
from hydraulic_sysid.diagnosis.grey_box.verdict import shares
from hydraulic_sysid.verbs import greybox

SAMPLE = Path(__file__).parents[2] / "examples" / "sample_bench"
DT = 2e-3


def measured(model: Model, seed: int, flow: float = 1.0) -> Record:
    """A run of a model over slow random motion, with sensor noise; its valve passes ``flow`` times what it should."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(6000)
    u = sum(rng.uniform(0.3, 1.2) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.3, 0.7, 1.1, 2.3))
    plant = Plant(model.with_values({"valve_flow": flow * model.value("valve_flow")}))
    run = plant.simulate(u, DT)
    channels = {"drive": u, "position": run["position"] + 2e-5 * rng.standard_normal(u.size)}
    for name in ("pressure_a", "pressure_b"):
        channels[name] = run[name] + 1e4 * rng.standard_normal(u.size)
    return Record.sampled(f"run{seed}", DT, channels)


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model("moog_mcr_m_1002_bench")


def test_of_an_exact_model_nothing_but_noise_is_left(model: Model) -> None:
    result = grey_box(model, [measured(model, 1), measured(model, 2)], [measured(model, 3)])
    assert result["verdict"]["level"] == "explained"
    for channel in result["channels"].values():
        assert channel["shares"]["noise"] > 0.7
        assert channel["shares"]["linear"] + channel["shares"]["nonlinear"] < 0.15
    assert "names all there is" in result["verdict"]["text"]


def test_a_wrong_gain_is_a_linear_thing_and_is_told_from_noise(model: Model) -> None:
    records = [measured(model, seed, flow=1.15) for seed in (1, 2, 3)]
    result = grey_box(model, records[:2], records[2:])
    share = result["channels"]["velocity"]["shares"]
    assert share["linear"] > 0.9
    assert result["verdict"]["level"] == "off"
    side = result["channels"]["velocity"]["test"]
    assert side["grey"] < 0.35 * side["white"]


def test_a_dead_band_is_a_nonlinear_thing_and_shows_in_the_terms(model: Model) -> None:
    plant = model.with_effect("valve_deadband").with_values({"valve_deadband.width": 0.04})
    records = [measured(plant, seed) for seed in (1, 2, 3)]
    result = grey_box(model, records[:2], records[2:])
    channel = result["channels"]["velocity"]
    # A lower gain comes close to a dead band, but not as close as a bend does.
    assert channel["shares"]["linear"] + channel["shares"]["nonlinear"] > 0.8
    assert channel["test"]["grey"] < 0.8 * channel["test"]["linear"] < 0.5 * channel["test"]["white"]
    assert {"direction of motion", "|drive|", "drive·|drive|"} & {t["name"] for t in channel["terms"]} or any(
        "bend" in t["name"] for t in channel["terms"]
    )
    assert sum(channel["shares"].values()) == pytest.approx(1.0)


def test_records_without_pressures_are_enough(model: Model) -> None:
    records = [measured(model, seed, 1.15) for seed in (1, 2)]
    bare = [Record.sampled(r.name, r.dt, {n: r[n] for n in ("drive", "position")}) for r in records]
    result = grey_box(model, bare[:1], bare[1:])
    assert list(result["channels"]) == ["velocity"]


def test_selection_takes_what_generalises_and_nothing_else() -> None:
    rng = np.random.default_rng(0)
    values = rng.standard_normal((2000, 30))
    blocks = np.arange(2000) // 50
    target = 2.0 * values[:, 3] - 1.0 * values[:, 17] + 0.5 * rng.standard_normal(2000)
    found = select(values, target, blocks)
    assert found.order == [3, 17]
    np.testing.assert_allclose(found.coefficients, [2.0, -1.0], atol=0.05)
    assert found.cross_validated == pytest.approx(0.25, rel=0.1)
    assert select(values, rng.standard_normal(2000), blocks).order == []


def test_shares_add_up_and_harm_explains_nothing() -> None:
    assert shares({"white": 2.0, "exact": 1.0, "linear": 1.5, "grey": 1.2}) == pytest.approx(
        {"noise": 0.25, "linear": 1 - 2.25 / 4, "nonlinear": 2.25 / 4 - 1.44 / 4, "unexplained": 0.75 - 1 + 1.44 / 4}
    )
    harm = shares({"white": 1.0, "exact": 0.1, "linear": 1.4, "grey": 1.3})
    assert harm["linear"] == harm["nonlinear"] == 0.0 and sum(harm.values()) == pytest.approx(1.0)
    assert shares({"white": 1.0, "exact": 2.0, "linear": 0.5, "grey": 0.5})["noise"] == 1.0


def test_the_verb_writes_document_and_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--model", "sample_bench", "--record", str(SAMPLE / "steps.csv.gz"), str(SAMPLE / "triangle.csv.gz")]
    assert greybox.main([*arguments, "--out", str(tmp_path)]) == 0
    result = results.read_result(tmp_path / "greybox.json")
    assert result["schema"] == "hydraulic_sysid.greybox/2"
    assert result["channels"]["velocity"]["shares"]["nonlinear"] > 0.5
    assert "What is left" in (tmp_path / "report.html").read_text()
    assert_cannot_inject(result)
    assert " ".join(result["verdict"]["text"].split()) in " ".join(capsys.readouterr().out.split())
    assert greybox.main([*arguments, "--out", str(tmp_path), "--json"]) == 0
    assert "traces" not in capsys.readouterr().out


def test_what_cannot_be_says_why(model: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(GreyBoxError, match="test on"):
        grey_box(model, [measured(model, 1)], [])
    short = measured(model, 1).window(0.0, 3.0)
    with pytest.raises(GreyBoxError, match="too short"):
        grey_box(model, [short], [short])
    arguments = ["--model", "sample_bench", "--record", str(SAMPLE / "steps.csv.gz"), "--holdout", "1.5"]
    assert greybox.main([*arguments, "--out", str(tmp_path / "x")]) == 2
    assert "between 0 and 1" in capsys.readouterr().err
