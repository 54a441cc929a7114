"""The designed experiment decides what an old record could not, and no other promise of it is broken."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hostile_page import assert_cannot_inject

from hydraulic_sim.model import Entry, Model
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import plain
from hydraulic_sysid.diagnosis.next_experiment import (
    Limits,
    NextExperimentError,
    Proposal,
    competing,
    limits_of,
    next_experiment,
)
from hydraulic_sysid.diagnosis.next_experiment.evidence import Point, as_record, evidence
from hydraulic_sysid.diagnosis.next_experiment.movements import FAMILIES, Bench, Movement, every
from hydraulic_sysid.diagnosis.next_experiment.reference import Leader, play
from hydraulic_sysid.estimation.fit import fit
from hydraulic_sysid.excitation import Plan, load_plan
from hydraulic_sysid.excitation.amplitude import largest
from hydraulic_sysid.excitation.design import Wish, propose
from hydraulic_sysid.excitation.simulated_run import Sensors, simulate_plan
from hydraulic_sysid.report import render
from hydraulic_sysid.verbs import next_experiment as verb

NOISE = {"position": 2e-5}
SECONDS = 8.0
TRUTH, OTHER = "spool_dynamics", "command_delay"
pytestmark = pytest.mark.timeout(400)  # it takes seconds where nothing else runs
DECIDED = 100.0  # difference of the sums of squares over the noise


@pytest.fixture(scope="module")
def base() -> Model:
    return load_model("sample_bench")


@pytest.fixture(scope="module")
def truth(base: Model) -> Model:
    return base.with_effect(TRUTH, {"frequency": 75.0, "damping": 0.7})


def played(plan: Plan, model: Model, seed: int, channels: tuple[str, ...] = ("position",)) -> Record:
    """A noisy record of a plan, of the part in which its signal plays."""
    record = simulate_plan(plan, Plant(model), Sensors(NOISE["position"], seed=seed)).record
    part = record.window(plan.signal_start, plan.signal_start + plan.active_time)
    return Record.sampled(f"seed {seed}", part.dt, {c: part[c] for c in ("drive", *channels)})


def ordinary(model: Model, seed: int) -> Plan:
    """What one would play without a design: a multisine over the slow part of the bandwidth."""
    plan = propose("random_phase_multisine", Wish(0.15, 2.0, SECONDS, seed=seed))
    return largest(plan, model, share=0.5).plan


def refitted(rivals: dict[str, Model], record: Record) -> tuple[dict[str, Model], float]:
    """The rivals fitted to a record, and by how much the true one fits better (sums of squares over the noise)."""
    models, costs = {}, {}
    for name, model in rivals.items():
        done = fit(model, [record], (*model.free_keys(), *model.nuisance_keys()))
        models[name], costs[name] = model.with_values(done.values), done.cost
    return models, costs[OTHER] - costs[TRUTH]


@pytest.fixture(scope="module")
def old(base: Model, truth: Model) -> tuple[dict[str, Model], float]:
    """The rivals, fitted to an ordinary record of the truth, and how little that record tells."""
    rivals = {name: base.with_effect(name) for name in (TRUTH, OTHER)}
    return refitted(rivals, played(ordinary(base, 1), truth, 11))


@pytest.fixture(scope="module")
def proposal(old: tuple[dict[str, Model], float]) -> Proposal:
    rivals, _ = old
    return next_experiment(rivals, limits_of(rivals), NOISE, SECONDS)


def test_the_proposed_experiment_decides_what_an_ordinary_one_does_not(
    base: Model, truth: Model, old: tuple[dict[str, Model], float], proposal: Proposal
) -> None:
    rivals, before = old
    assert abs(before) < 30.0  # what a diagnosis calls a tie
    _, again = refitted(rivals, played(ordinary(base, 2), truth, 12))
    assert abs(again) < 30.0
    _, after = refitted(rivals, played(proposal.plan, truth, 13))
    assert after > DECIDED
    promised = next(p for p in proposal.document["pairs"] if p["true"] == TRUTH)["chi_square"]
    assert after == pytest.approx(promised, rel=0.3)
    assert proposal.document["verdict"]["level"] == "explained"


def test_every_rival_keeps_the_limits_with_a_tenth_to_spare(
    old: tuple[dict[str, Model], float], proposal: Proposal
) -> None:
    limits = limits_of(old[0])
    for model in old[0].values():
        seen = simulate_plan(proposal.plan, Plant(model))
        assert not seen.aborted
        assert seen.extremes.drive_peak <= limits.drive
        assert max(seen.extremes.position_max, -seen.extremes.position_min) <= 0.9 * limits.travel + 1e-9
        assert seen.extremes.velocity_peak <= 0.9 * limits.velocity + 1e-9
        assert limits.pressure_min < seen.extremes.pressure_min
        assert seen.extremes.pressure_max < limits.pressure_max
    assert proposal.plan.travel_limit == pytest.approx(1.1 * limits.travel)


def test_the_plan_is_saved_with_its_drive_and_can_be_moved(proposal: Proposal, tmp_path: Path) -> None:
    file = proposal.save(tmp_path / "made")
    (tmp_path / "made").rename(tmp_path / "moved")
    plan = load_plan(tmp_path / "moved" / file.name)
    np.testing.assert_array_equal(plan.open_loop, proposal.plan.open_loop)
    assert plan.prediction == proposal.plan.prediction
    assert plan.active_time == pytest.approx(SECONDS)
    with pytest.raises(NextExperimentError, match="never overwritten"):
        proposal.save(tmp_path / "moved")


def test_the_document_and_its_page(proposal: Proposal) -> None:
    document = plain(proposal.document)
    json.dumps(document, allow_nan=False)
    assert {r["name"] for r in document["competing_models"]} == {TRUTH, OTHER}
    assert {(p["true"], p["refitted"]) for p in document["pairs"]} == {(TRUTH, OTHER), (OTHER, TRUTH)}
    for pair in document["pairs"]:
        assert pair["separation"] == pytest.approx(0.5 * math.sqrt(pair["chi_square"]))
        assert pair["seconds_needed"] == pytest.approx(SECONDS * 25.0 / pair["separation"] ** 2)
        assert sum(pair["channel_shares"].values()) == pytest.approx(1.0)
    chosen, *others = document["compared_experiments"]
    assert chosen["kind"] == "chosen"
    assert chosen["separation"] >= 0.95 * max(o["separation"] for o in others)
    page = render([document])
    assert "Where their predictions part" in page and OTHER in page
    assert_cannot_inject(document)


def test_a_refit_takes_away_what_free_parameters_explain(base: Model) -> None:
    """A change of free parameters is taken away by a refit, and two experiments tell more than one."""
    lead = Point("a", base)
    changed = Point("b", base.with_values({"coulomb_friction.level": 460.0, "valve_flow": 2.51e-3}))
    bench = Bench(8.0, 0.5, 0.0, 2.0, 1000.0)
    run = play(lead.plant, Leader.of(base), [Movement("triangle", {"amplitude": 0.3, "cycles": 2.0})], bench)
    noise = {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}
    record = as_record("triangle", run.trajectory, 1e-3, list(noise), 1.0)
    found = evidence([lead, changed], [(0, 1), (1, 0)], record, noise, 0.5)
    left = found.left([lead, changed])
    for pair in ((0, 1), (1, 0)):
        assert found.squares[pair] > 100.0
        assert left[pair] < 0.02 * found.squares[pair]
    twice = (found + found).left([lead, changed])
    assert all(twice[p] >= left[p] for p in left)


@pytest.mark.thorough
def test_tight_limits_give_a_small_experiment_impossible_ones_an_error(base: Model) -> None:
    rivals = {name: base.with_effect(name) for name in ("valve_deadband", "valve_hysteresis")}
    tight = replace(limits_of(rivals), drive=2.0, travel=0.01, velocity=0.05)
    seen = next_experiment(rivals, tight, NOISE, 3.0).document["prediction"]
    assert max(seen["position_max"], -seen["position_min"]) <= 0.009 + 1e-9
    assert seen["velocity_peak"] <= 0.045 + 1e-9 and seen["drive_peak"] <= 2.0
    with pytest.raises(NextExperimentError, match="no movement keeps the limits"):
        next_experiment(rivals, replace(tight, pressure_min=10e6), NOISE, 3.0)


@pytest.mark.thorough
def test_equal_rivals_are_said_to_be_so(base: Model) -> None:
    rivals = {"one": base, "other": base.with_effect("valve_null_bias", {"bias": 0.0})}
    document = next_experiment(rivals, limits_of(rivals), NOISE, 3.0).document
    assert document["verdict"]["level"] == "off"
    assert "No experiment within the limits" in document["verdict"]["text"]


@pytest.mark.parametrize("movement", every(), ids=lambda m: "-".join([m.kind, *(f"{v:g}" for v in m.numbers.values())]))
def test_a_movement_fills_its_time_and_stays_within_the_drive(movement: Movement) -> None:
    bench = Bench(9.0, 0.5, 0.1, 5.0, 1000.0)
    phases = movement.phases(bench)
    assert sum(p.samples for p in phases) == 5000
    for phase in phases:
        if phase.drive is not None:
            assert phase.drive.shape == (phase.samples,)
            assert np.abs(phase.drive).max(initial=0.0) <= bench.drive + 1e-9
        else:
            assert abs(phase.target - bench.centre) <= bench.travel and 0.0 < phase.most <= bench.drive
    low, high = FAMILIES[movement.kind].ranges[movement.family.size]
    assert low <= movement.scaled(1e-9).numbers[movement.family.size] <= high


def test_the_way_to_a_position_arrives(base: Model) -> None:
    bench = Bench(9.0, 0.5, 0.0, 5.0, 1000.0)
    point = Point("a", base)
    movement = Movement("hold", {"position": 0.6, "drive": 0.8})
    run = play(point.plant, Leader.of(base), [movement], bench)
    assert run.trajectory.position[3900] == pytest.approx(0.3, abs=0.01)
    assert run.trajectory.position[-1] < 0.15
    assert np.abs(run.drive).max() <= bench.drive


@pytest.mark.thorough
def test_an_axis_without_hydraulics() -> None:
    axis = Model(
        name="axis",
        kind="mechanical",
        entries={
            "moving_mass": Entry(90.0),
            "drive_force": Entry(35.0),
            "stroke": Entry(0.5),
            "coulomb_friction.level": Entry(20.0),
        },
        effects=("coulomb_friction", "viscous_friction"),
    )
    rivals = {
        "friction_asymmetry": axis.with_effect("friction_asymmetry", {"difference": 5.0}),
        "constant_load": axis.with_effect("constant_load", {"load": 5.0}),
    }
    limits = limits_of(rivals)
    assert limits.velocity == math.inf
    proposal = next_experiment(rivals, limits, NOISE, 4.0)
    assert proposal.document["verdict"]["level"] == "explained"
    assert proposal.document["limits"]["velocity"] == math.inf
    assert "pressure_a" not in proposal.document["traces"]
    assert render([plain(proposal.document)])


@pytest.mark.parametrize(
    ("rivals", "noise", "seconds", "complaint"),
    [
        (1, NOISE, 20.0, "1 model given"),
        (2, {}, 20.0, "the position's is needed"),
        (2, {"position": 0.0}, 20.0, "noise of position is 0"),
        (2, {"position": 1e-5, "smell": 1.0}, 20.0, "'smell'"),
        (2, NOISE, 0.5, "seconds is 0.5"),
    ],
)
def test_questions_that_make_no_sense(base: Model, rivals: int, noise: dict, seconds: float, complaint: str) -> None:
    models = {name: base.with_effect(name) for name in ("valve_deadband", "valve_hysteresis")[:rivals]}
    with pytest.raises(NextExperimentError, match=complaint):
        next_experiment(models, Limits(9.5, 0.5, 0.4, 2e5, 17e6), noise, seconds)


def test_the_verb_on_a_diagnosis(
    old: tuple[dict[str, Model], float], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "diagnosed", tmp_path / "next"
    folder.mkdir()
    document = {
        "schema": "hydraulic_sysid.diagnose/2",
        "verdict": {"effects": [TRUTH, OTHER], "text": "one of two"},
        "settings": {"segment_length": 0.5},
        "noise_std": {"position": {"first": 1.9e-5, "second": 2.1e-5}},
    }
    (folder / "diagnose.json").write_text(json.dumps(document))
    save_model(old[0][OTHER], folder / f"competing_{OTHER}.yaml")
    arguments = ["--diagnosis", str(folder), "--out", str(out), "--seconds", "3", "--json"]
    assert verb.main(arguments) == 2
    assert "holds 1 competing models" in capsys.readouterr().err
    save_model(old[0][TRUTH], folder / "model.yaml")
    assert verb.main(arguments) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["noise_std"] == {"position": pytest.approx(2e-5)}
    assert {r["name"] for r in printed["competing_models"]} == {TRUTH, OTHER}
    assert load_plan(out / "next_experiment.yaml").prediction is not None
    assert (out / "report.html").is_file()
    assert verb.main(arguments) == 2
    assert "never overwritten" in capsys.readouterr().err


def test_the_verb_names_models_by_what_only_they_have(
    base: Model, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = []
    for name in ("valve_deadband", "valve_hysteresis"):
        files.append(str(tmp_path / f"{name[-3:]}.yaml"))
        save_model(base.with_effect(name), Path(files[-1]))
    assert list(competing.of_files(files)) == ["valve_deadband", "valve_hysteresis"]
    assert list(competing.of_files([files[0], "sample_bench"])) == ["and", "sample_bench"]
    assert verb.main(["--model", *files, "--out", str(tmp_path / "out")]) == 2
    assert "--noise" in capsys.readouterr().err
