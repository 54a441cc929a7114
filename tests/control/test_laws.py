"""Every law: one file, what it declares, what it does with its own model, with nonsense, and when it takes over."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_control import gains_file, parameters
from hydraulic_control.comparison import MODEL
from hydraulic_control.controller import Controller
from hydraulic_control.errors import ControlError
from hydraulic_control.inverse import of_model
from hydraulic_control.law import SimpleModel
from hydraulic_control.laws import VARIABLE, laws
from hydraulic_control.response import StepFigures, TrackingFigures, tracking_figures
from hydraulic_control.simulation import QUIET
from hydraulic_control.trials import TRIALS
from hydraulic_sim.model_file import load_model

DT = 1e-3
FOLDER = Path(str(sys.modules[laws.__module__].__file__)).parent
GAIN = {"kp": 60.0, "ki": 60.0, "kd": 0.1}
every_law = pytest.mark.parametrize("law", parameters.CONTROLLERS)


class Axis:
    """K/(s(Ts + 1)) behind a drive that is a little off."""

    def __init__(self, gain: float = 0.0434, lag: float = 5e-3, bias: float = 0.1) -> None:
        self.gain, self.lag, self.bias, self.x, self.v = gain, lag, bias, 0.0, 0.0

    def move(self, drive: float) -> float:
        self.v += DT / self.lag * (self.gain * (drive + self.bias) - self.v)
        self.x += DT * self.v
        return self.x


def followed(controller: Controller, axis: Axis, goal: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and drives."""
    trace = []
    for _ in range(count):
        drive = controller.step(DT, goal, 0.0, axis.x)
        trace.append((axis.move(drive), drive))
    return np.array(trace).T[0], np.array(trace).T[1]


@every_law
def test_a_law_is_one_short_file_that_says_what_it_is(law: str) -> None:
    assert len((FOLDER / f"{law}.py").read_text(encoding="utf-8").splitlines()) <= 120
    found = laws()[law]
    assert found.description and found.source and found.tuned
    for spec in found.parameters:
        assert spec.description and (spec.unit or isinstance(spec.default, str)), spec
        assert spec.live or isinstance(spec.default, str), spec
    assert set(found.tuned) <= set(parameters.SPECS)
    for start in found.starts(SimpleModel(0.04, 5e-3), [GAIN]):
        Controller({"controller": law, **start})


@every_law
def test_a_law_says_what_is_published_of_it_in_terms_of_the_trials(law: str) -> None:
    claims = laws()[law].claims
    assert claims
    figures = {f.name for kind in (StepFigures, TrackingFigures) for f in fields(kind)}
    for claim in claims:
        assert claim.text and claim.low < claim.high and claim.figure in figures
        assert claim.trial in TRIALS and claim.over_trial in ("", *TRIALS)
        assert claim.over in ("", MODEL, *set(laws()) - {law})


def test_a_low_bandwidth_stays_below_the_resonance() -> None:
    values = {"controller": "low_bandwidth", "low_bandwidth.frequency": 60.0, "low_bandwidth.damping": 0.05}
    Controller({**values, "low_bandwidth.bandwidth": 5.0})
    for bandwidth in (30.0, 80.0):
        with pytest.raises(ControlError, match="at the resonance of 60 rad/s"):
            Controller({**values, "low_bandwidth.bandwidth": bandwidth})


@every_law
def test_the_table_of_the_docs_has_it(law: str) -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "control.md").read_text(encoding="utf-8")
    (row,) = (line for line in text.splitlines() if line.startswith(f"| `{law}` |") and line.count("|") == 4)
    assert row.endswith(f"| {laws()[law].needs or '–'} |")


def test_no_list_of_laws_is_kept_anywhere_else() -> None:
    assert set(parameters.CONTROLLERS) == {p.stem for p in FOLDER.glob("[!_]*.py")}
    assert set(parameters.CONTROLLERS) == set(gains_file.shipped()), "and each has gains"


@every_law
def test_shipped_gains_bring_an_axis_to_the_goal_despite_a_bias(law: str) -> None:
    positions, drives = followed(Controller(gains_file.load(law)), Axis(), 0.02, 3000)
    assert positions[-1] == pytest.approx(0.02, abs=1e-4)
    assert positions.max() < 0.024
    assert np.abs(drives).max() <= 10.0


@every_law
def test_after_nonsense_a_law_is_as_if_new(law: str) -> None:
    values = {"controller": law, "bumpless_time": 1e-3}
    spoilt, fresh = Controller(values), Controller(values)
    for wild in (1e300, -1e300, 1e-300, 1e160, math.nan, 3.0, -1e200, 1e308):
        for force in (wild, math.inf, math.nan):
            drive = spoilt.step(DT, wild, wild, -wild, force)
            assert math.isfinite(drive) and abs(drive) <= 10.0
    spoilt.step(DT, math.nan, 0.0, 0.0)
    fresh.step(DT, math.nan, 0.0, 0.0)
    ours = [c.step(DT, 0.01, 0.0, 0.001 * i, 100.0) for i in range(5) for c in (spoilt, fresh)]
    assert ours[0::2] == ours[1::2]


@every_law
def test_laws_are_changed_without_a_bump(law: str) -> None:
    """From any to any, while the drive is 1.2 V: it goes on from there."""
    other = parameters.CONTROLLERS[(parameters.CONTROLLERS.index(law) + 5) % len(parameters.CONTROLLERS)]
    loop, x = Controller({"controller": law}), 0.0
    for i in range(200):
        x = 0.05 * i * DT
        loop.step(DT, x + 1e-3, 0.05, x)
    before = loop.drive
    loop.set({"controller": other})
    assert loop.step(DT, x + 1e-3, 0.05, x) == pytest.approx(before, abs=0.02 + 1e-2 * abs(before))


def test_shipped_gains_are_of_their_law() -> None:
    for name in gains_file.shipped():
        assert gains_file.load(name)["controller"] == name


USER_LAW = """
from hydraulic_control.law import Law, number

def begin(p, s, position):
    s.count = 0.0

def drive(p, s, dt, reference, reference_velocity, position):
    s.count += 1.0
    return p.gain * (reference - position)

LAW = Law(
    description="proportional", source="the user", begin=begin, drive=drive,
    parameters=(number("mine.gain", 30.0, "gain", "V/m", 0.0, 1e4),), state=(("count", ()),), tuned=("mine.gain",),
    starts=lambda simple, gains: [{}],
)
"""


def said(file: Path, program: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, VARIABLE: str(file), "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    return subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)


def test_a_law_of_the_users_own_joins_by_its_file(tmp_path: Path) -> None:
    """Nothing else is touched: parameters, checks and the compiled step follow from it."""
    file = tmp_path / "mine.py"
    file.write_text(USER_LAW)
    done = said(
        file,
        "from hydraulic_control.controller import Controller\n"
        "c = Controller({'controller': 'mine', 'mine.gain': 40.0, 'bumpless_time': 1e-3})\n"
        "for _ in range(99): c.step(1e-3, 0.01, 0.0, 0.0)\n"
        "print(round(c.drive, 6))",
    )
    assert (done.returncode, done.stdout.strip()) == (0, "0.4"), done.stderr


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("mine.py", "x = 1", "defines no constant LAW"),
        ("mine.py", "1/0", "ZeroDivisionError"),
        ("npid.py", USER_LAW, "there is a law 'npid' already"),
        ("mine.py", USER_LAW.replace("mine.gain", "kp"), "belong to others"),
        ("mine.txt", USER_LAW, "no Python file"),
        ("mine.py", USER_LAW.replace("return p.gain", "return p.gian"), "does not compile"),
    ],
)
def test_a_file_that_is_no_law_is_told(tmp_path: Path, name: str, text: str, complaint: str) -> None:
    file = tmp_path / name
    file.write_text(text)
    done = said(
        file,
        "from hydraulic_control.errors import ControlError\n"
        "try:\n"
        "    from hydraulic_control.controller import Controller\n"
        "    Controller({'controller': 'mine'})\n"
        "except ControlError as error: print(error)",
    )
    assert complaint in done.stdout, done.stdout + done.stderr


class TestInverse:
    """The steady inverse of a model."""

    model = load_model("moog_mcr_m_1002_bench")

    def test_it_inverts_what_the_model_does(self) -> None:
        hidden = self.model.with_effect("valve_deadband", {"width": 0.04})
        found = of_model(hidden, 161)
        assert (np.diff(found.speeds) > 0.0).all() and (np.diff(found.drives) > 0.0).all()
        edge = float(np.interp(2e-3, found.speeds, found.drives))
        assert 0.4 < edge < 0.6, "4 % of 10 V, and what friction asks for"
        assert float(np.interp(-2e-3, found.speeds, found.drives)) == pytest.approx(-edge, rel=0.05)
        assert found.pressure == pytest.approx(13.7e6) and 3e-3 < found.lag < 2e-2

    def test_a_model_that_does_not_move_is_refused(self) -> None:
        with pytest.raises(ControlError, match="cannot be inverted"):
            of_model(self.model.with_effect("constant_load", {"load": 3e5}), 41)
        with pytest.raises(ControlError, match="a force, no speed"):
            of_model(replace(self.model, kind="mechanical"), 41)

    @pytest.mark.parametrize("name", ["nothing.yaml", "a" * 5000, "\0", "/etc"])
    def test_a_file_that_is_none_is_told(self, name: str) -> None:
        with pytest.raises(ControlError, match="model_inversion.model"):
            Controller({"controller": "model_inversion", "model_inversion.model": name})

    def test_what_the_diagnosis_adds_makes_the_control_better(self) -> None:
        """A sine on a plant with a dead band that one model knows and the other does not, and the best PID."""
        true = self.model.with_effect("valve_deadband", {"width": 0.04})
        sine = TRIALS["sine"]

        def error(values: dict[str, Any]) -> float:
            return tracking_figures(sine.response(values, true, 0.02, QUIET, 0)).rms_error

        gains = gains_file.load("model_inversion")
        before = error(gains)
        found = of_model(true, 161)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("hydraulic_control.inverse.inverse", lambda name, size: found)
            after = error(gains)
        assert after < 0.5 * before and after < error(gains_file.load("pid")) / 3.0


def test_every_parameter_reaches_the_record_of_its_law() -> None:
    def field(controller: Controller, name: str) -> Any:
        return controller.compiled[1][name][0]

    for name, law in laws().items():
        for spec in law.parameters:
            if isinstance(spec.default, float):
                value = 0.5 * (spec.default + (spec.maximum if spec.maximum is not None else 1.0))
                try:
                    made = Controller({"controller": name, spec.name: value})
                except ControlError:  # poles that its period cannot have
                    continue
                assert field(made, law.field(spec.name)) == value
