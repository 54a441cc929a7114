"""Relay experiment, rules, optimisation, and the verbs around them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_control import evaluation, gains_file, rules
from hydraulic_control.controller import Controller
from hydraulic_control.errors import ControlError
from hydraulic_control.identified import from_coefficients
from hydraulic_control.margins import critical_point, grid
from hydraulic_control.optimisers import OPTIMISERS, Objective
from hydraulic_control.parameters import CONTROLLERS
from hydraulic_control.relay import CriticalPoint, Relay, RelaySettings, measure
from hydraulic_control.scenario import nominal, scattered
from hydraulic_control.simulation import QUIET, SensorNoise, SimulatedPlant, run, step_reference
from hydraulic_control.tune_run import simple_model
from hydraulic_control.tuning import Criteria, cost_of, figures_of, optimise, try_step
from hydraulic_control.verbs import evaluate, tune
from hydraulic_node_utils.parameter_spec import ParameterError
from hydraulic_sim.linear import poles, velocity_gain
from hydraulic_sim.model_file import load_model

MODEL = load_model("moog_mcr_m_1002_bench")


class Oscillator:
    """K·ω³/((s + ω)³) integrated finely: its critical point is the same at every amplitude."""

    def __init__(self, gain: float = 0.01, omega: float = 20.0) -> None:
        self.gain, self.omega, self.x = gain, omega, np.zeros(3)

    def step(self, drive: float, dt: float) -> tuple[float, float, float]:
        out = float(self.x[2])
        for _ in range(20):
            before = np.concatenate(([self.gain * drive], self.x[:2]))
            self.x = self.x + dt / 20 * self.omega * (before - self.x)
        return out, math.nan, drive


def test_the_relay_finds_the_critical_point_of_a_linear_plant() -> None:
    point = measure(Oscillator(), RelaySettings(1.0, hysteresis=0.0, travel=1.0))
    omega = grid()
    expected = critical_point(omega, 0.01 / (1.0 + 1j * omega / 20.0) ** 3)
    assert expected is not None
    # A relay's describing function leaves out the harmonics, which three lags damp to a few percent.
    assert point.gain == pytest.approx(expected.gain, rel=0.05)
    assert point.period == pytest.approx(expected.period, rel=0.03)


def test_on_the_plant_noise_hardly_matters() -> None:
    quiet, noisy = (measure(SimulatedPlant(MODEL, noise), RelaySettings()) for noise in (QUIET, SensorNoise()))
    assert noisy.gain == pytest.approx(quiet.gain, rel=0.1)
    assert noisy.period == pytest.approx(quiet.period, rel=0.05)


@pytest.mark.parametrize(
    ("settings", "positions", "complaint"),
    [
        (RelaySettings(travel=0.001), [0.0, 0.0005, 0.0011], "travelled"),
        (RelaySettings(time_limit=0.1), [0.0] * 200, "no steady oscillation"),
        (RelaySettings(), [0.0, math.nan], "not a number"),
    ],
)
def test_the_relay_ends_at_its_limits(settings: RelaySettings, positions: list[float], complaint: str) -> None:
    relay = Relay(settings)
    drives = [relay.step(1e-3, p) for p in positions]
    assert relay.done and relay.result is None and complaint in relay.trouble
    assert drives[-1] == 0.0
    assert max(abs(d) for d in drives) <= 1.2 * settings.amplitude


def test_relay_settings_have_ranges() -> None:
    for wrong in ({"amplitude": 11.0}, {"cycles": 1}, {"travel": math.inf}, {"time_limit": 0.0}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            RelaySettings(**wrong)  # type: ignore[arg-type]


def test_the_rules() -> None:
    point = CriticalPoint(220.0, 0.1)
    assert rules.ziegler_nichols(point) == rules.Gains(132.0, 132.0 / 0.05, 132.0 * 0.0125)
    assert rules.tyreus_luyben(point).kp == pytest.approx(100.0)
    assert rules.tyreus_luyben(point).ki == pytest.approx(100.0 / 0.22)


@pytest.mark.parametrize("lag", [0.005, 0.1])
def test_placed_gains_place_the_poles(lag: float) -> None:
    g = rules.pole_placement(0.04, lag, 15.0, 0.8)
    slow_lag = [0.0] if g.kd == 0.0 and lag * (1.5 + 24.0) < 1.0 else [lag]
    poles = np.roots([*slow_lag, 1.0 + 0.04 * g.kd, 0.04 * g.kp, 0.04 * g.ki])
    if slow_lag == [lag]:
        wanted = [-1.5, *np.roots([1.0, 24.0, 225.0])]
        assert sorted(np.abs(poles)) == pytest.approx(sorted(np.abs(wanted)), rel=1e-6)
    assert np.all(poles.real < 0.0)
    with pytest.raises(ControlError, match="positive"):
        rules.pole_placement(0.04, lag, -1.0)


def test_optimising_lowers_the_cost_and_keeps_what_is_not_free() -> None:
    cases = [nominal(MODEL, QUIET), *scattered(MODEL, 1, 3, QUIET)]
    start = {"controller": "pid", "kp": 60.0, "ki": 20.0, "tracking_time": 0.3}
    tuned = optimise(start, cases, [0.05], Criteria(), ["kp", "ki"], 0.8, 25)
    assert tuned.cost < 0.7 * tuned.start_cost
    assert tuned.cost == cost_of(tuned.values, cases, [0.05], Criteria(), 0.8)
    assert tuned.values["tracking_time"] == 0.3
    assert tuned.trials <= 40
    with pytest.raises(ControlError, match="cannot be optimised"):
        optimise(start, cases, [0.05], Criteria(), ["antiwindup"])


def bowl(x: np.ndarray) -> float:
    """Least at (0.7, −0.4), where it is 0.1; narrow one way."""
    return float(0.1 + (x[0] - 0.7) ** 2 + 9.0 * (x[1] + 0.4) ** 2)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_an_optimiser_finds_the_least_in_its_trials_and_finds_it_again(name: str) -> None:
    found = []
    for seed in (3, 3, 4):
        objective = Objective(bowl, 2, bowl(np.zeros(2)))
        OPTIMISERS[name](objective, 240, seed)
        assert 100 < objective.trials <= 245
        assert objective.lowest == bowl(objective.best)
        assert objective.best == pytest.approx([0.7, -0.4], abs=0.05)
        found.append(objective.best.tolist())
    assert found[0] == found[1]
    assert (found[0] == found[2]) == (name == "nelder_mead")


def test_gains_are_tuned_by_a_swarm_too() -> None:
    cases, start = [nominal(MODEL, QUIET)], {"controller": "pid", "kp": 60.0, "ki": 20.0}
    runs = [
        optimise(start, cases, [0.05], Criteria(), ["kp", "ki"], 0.8, 36, "particle_swarm", seed) for seed in (1, 1)
    ]
    assert runs[0] == runs[1] and runs[0].cost < 0.7 * runs[0].start_cost and runs[0].trials == 36
    assert optimise(start, cases, [0.05], Criteria(), ["kp"], 0.8, 0).values == start


@pytest.mark.parametrize("preset", ["moog_mcr_m_1002_bench", "festo_hanging_load"])
def test_laws_begin_from_the_resonance_and_the_gain_of_any_cylinder(preset: str) -> None:
    model = load_model(preset)
    simple = simple_model(model, [])
    assert simple.velocity_gain == pytest.approx(velocity_gain(model))
    pair = min((p for p in poles(model) if p.imag > 0.0), key=abs)
    assert simple.frequency == pytest.approx(abs(pair), rel=1e-6) and 0.0 < simple.damping < 0.2
    chirp = from_coefficients([100.0], np.polymul([1.0, 0.0], [1.0, 2.0 * 0.2 * 60.0, 3600.0]), None)
    assert simple_model(model, [chirp])[2:] == pytest.approx((60.0, 0.2))


def test_criteria() -> None:
    good = figures_of(try_step(gains_file.load("npid"), nominal(MODEL, QUIET), 0.05, 1.5))
    assert good is not None
    assert Criteria().cost(good, 0.05) < 0.2 < Criteria(rise=0.01).cost(good, 0.05)
    with pytest.raises(ControlError, match="rise"):
        Criteria(rise=0.0)


def test_scattered_plants_differ_and_come_back() -> None:
    values = {"controller": "pid", "kp": 200.0}
    rises = [try_step(values, case, 0.05, 0.3).position[-1] for case in scattered(MODEL, 4, 11, QUIET)]
    again = [try_step(values, case, 0.05, 0.3).position[-1] for case in scattered(MODEL, 4, 11, QUIET)]
    assert rises == again and len(set(rises)) == 4


@pytest.mark.parametrize("law", ["npid", "pole_placement", "fuzzy_neural", "mpc"])
def test_the_compiled_loop_is_the_loop_sample_by_sample(law: str) -> None:
    reference = step_reference(0.03)
    controller = Controller({"controller": law, "kp": 150.0, "ki": 200.0, "force_feedback": 1e-5})
    whole = run(SimulatedPlant(MODEL, QUIET), controller, reference, 0.4)
    controller.stop()
    plant, drive = SimulatedPlant(MODEL, QUIET), 0.0
    for i in range(400):
        position, force, applied = plant.step(drive, 1e-3)
        assert whole.position[i] == pytest.approx(position, abs=1e-12)
        assert whole.drive[i] == pytest.approx(applied, abs=1e-9)
        drive = controller.step(1e-3, *reference(1e-3 * i), position, force)


@pytest.mark.parametrize("law", CONTROLLERS)
def test_shipped_gains_beat_the_paper_on_the_bench_preset(law: str) -> None:
    """A step of 50 mm: all of the paper's three figures at once, and settled within 0.6 s with less than 2 %."""
    values = gains_file.load(law)
    assert values["controller"] == law
    figures = figures_of(try_step(values, nominal(MODEL, SensorNoise()), 0.05, 3.0))
    assert figures is not None
    assert figures.rise_time <= 0.28
    assert figures.settling_time < 0.6
    assert figures.overshoot < 2.0
    assert figures.steady_state_error < 2.4e-5, "a step of the sensor"


def test_no_scattered_plant_is_left_unstable() -> None:
    result = evaluation.over_scatter(gains_file.load("npid"), MODEL, 20, 5, 0.05, SensorNoise(), Criteria())
    assert (result["plants"], result["ran_away"], result["unsettled"]) == (20, 0, 0)
    assert result["median"]["rise_time"] <= result["worst"]["rise_time"] < 0.28


def test_hidden_effects_leave_the_loop_stable() -> None:
    hidden = {"valve_deadband": {"width": 0.03}, "supply_droop": {"resistance": 2e9}, "command_delay": {}}
    for name, values in hidden.items():
        case = nominal(MODEL.with_effect(name, values), QUIET)
        figures = figures_of(try_step(gains_file.load("npid"), case, 0.05, 3.0))
        assert figures is not None and figures.overshoot < 10.0 and figures.steady_state_error < 2e-3, name


def test_gains_files(tmp_path: Path) -> None:
    file = tmp_path / "gains.yaml"
    values = Controller({"kp": 123.45, "controller": "pid"}).values
    file.write_text(gains_file.text(values, "from nowhere\nin two lines"))
    assert gains_file.load(file) == values
    assert "# from nowhere" in file.read_text() and "V/m; proportional gain" in file.read_text()
    for text, complaint in (
        ("a: b", "ros__parameters"),
        ("{", "cannot be read"),
        ("/actuator/controller:\n  ros__parameters:\n    kp: -1.0\n", "kp is -1"),
        ("/a/controller: {ros__parameters: {kp: 1.0}}\n/b/controller: {ros__parameters: {kp: 2.0}}", "expected one"),
        ("/actuator/controller:\n  ros__parameters:\n    speed: 1.0\n", "no parameter"),
    ):
        file.write_text(text)
        with pytest.raises(ControlError, match=complaint):
            gains_file.load(file)
    with pytest.raises(ControlError, match="shipped are"):
        gains_file.load("turbo")
    file.write_text("/left/controller: {ros__parameters: {kp: 150.0}}")
    assert gains_file.load(file) == {"kp": 150.0}


@pytest.fixture
def identified(tmp_path: Path) -> Path:
    """A chirp's ARX model of the plant: integrator with the plant's gain, and two fast poles."""
    folder = tmp_path / "chirp"
    folder.mkdir()
    fast = np.poly([0.1, -0.2])
    gain = 0.0432 * 0.05 * np.polyval(fast, 1.0)
    model = {"numerator": [gain], "denominator": np.polymul([1.0, -1.0], fast).tolist(), "sampling_time": 0.05}
    (folder / "linear_model.json").write_text(json.dumps({**model, "numerator": [gain, 0.0]}))
    assert from_coefficients(**model).velocity_gain == pytest.approx(0.0432, rel=1e-6)
    return folder / "linear_model.json"


def test_tune_writes_a_file_that_evaluate_and_the_node_read(
    tmp_path: Path, identified: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, relay = tmp_path / "new.yaml", tmp_path / "relay.json"
    relay.write_text(json.dumps({"critical_gain": 900.0, "critical_period": 0.03}))
    arguments = ["--controller", "pid", "--trials", "6", "--plants", "1", "--steps", "0.05", "--out", str(out)]
    assert tune.main([*arguments, "--identified", str(identified), "--relay", str(relay)]) == 0
    printed = capsys.readouterr().out
    for text in ("linearised at rest", "relay on the bench", "identified chirp", "tyreus_luyben", str(out)):
        assert text in printed
    assert gains_file.load(out)["controller"] == "pid"
    assert tune.main(arguments) == 2
    assert "exists" in capsys.readouterr().err
    bench = tmp_path / "bench.json"
    time = 1e-3 * np.arange(2000)
    columns = {"time": time, "reference": 0.05 * (time > 0.5), "position": 0.05 * (time > 0.55), "drive": 0.0 * time}
    bench.write_text(json.dumps({"kind": "step", **{k: v.tolist() for k, v in columns.items()}}))
    options = ["--gains", str(out), "--identified", str(identified), "--bench", str(bench), "--scatter", "3"]
    assert evaluate.main(options) == 0
    printed = capsys.readouterr().out
    for text in ("identified chirp", "nonlinear", "bench", "0.25 / 2.1 / 4.5", "agree", "median", "worst", "staircase"):
        assert text in printed
    assert evaluate.main([*options, "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)[out.stem]
    assert {row["where"] for row in document["rows"]} == {"identified chirp", "nonlinear", "bench"}


def test_a_response_with_gaps_is_judged_with_a_word_on_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.delete(1e-3 * np.arange(2000), np.s_[1000:1100])
    columns = {"time": time, "reference": 0.05 * (time > 0.5), "position": 0.05 * (time > 0.55), "drive": 0.0 * time}
    bench = tmp_path / "bench.json"
    bench.write_text(json.dumps({"kind": "step", **{k: v.tolist() for k, v in columns.items()}}))
    assert evaluate.main(["--bench", str(bench), "--json"]) == 0
    shown = capsys.readouterr()
    assert "bench.json: 5% of the states were not heard, for up to 101 ms" in shown.err
    assert json.loads(shown.out)["npid"]["rows"]


@pytest.mark.parametrize(
    ("verb", "arguments", "complaint"),
    [
        (evaluate, ["--gains", "turbo"], "no such parameter file"),
        (evaluate, ["--model", "no_such_model"], "no_such_model"),
        (evaluate, ["--identified", "none.json"], "none.json"),
        (evaluate, ["--bench", "none.json"], "none.json"),
        (evaluate, ["--step", "-1"], "positive"),
        (tune, ["--out", "/no/such/folder/x.yaml"], "does not exist"),
        (tune, ["--out", "x.yaml", "--relay", "none.json"], "none.json"),
        (tune, [], "--out"),
    ],
)
def test_bad_input_is_one_clear_line(
    verb: Any,
    arguments: list[str],
    complaint: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert verb.main(arguments) == 2
    error = capsys.readouterr().err
    assert complaint in error and "Traceback" not in error
