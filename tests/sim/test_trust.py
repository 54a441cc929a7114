"""Effect files are Python: which of them a model file may name, and that nothing runs before the rest is in order."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hydraulic_sim.errors import ModelError
from hydraulic_sim.model_file import load_model
from hydraulic_sim.trust import VARIABLE

EFFECT = """
from pathlib import Path
Path({trace!r}).write_text("it ran")
from hydraulic_sim.effect import Effect, Parameter

def flow(pressure_difference, coefficient):
    return -coefficient * pressure_difference, coefficient * pressure_difference

EFFECT = Effect(
    slot="flow", summary="a leak", kernel=flow,
    parameters=(Parameter("coefficient", "m^3/(s*Pa)", 1e-12, (0.0, 1e-9), "leakage", "made up", null=0.0),),
    equation="q = c*PL", source="made up", excited_by="load", confused_with=(), distinguished_by="-",
)
"""
MODEL = """\
format: hydraulic-model-1
parameters:
  {{moving_mass: 500 kg, piston_area_a: 80 cm^2, piston_area_b: 80 cm^2, stroke: 1.5 m, dead_volume_a: 0.3 l,
   dead_volume_b: 0.3 l, bulk_modulus: 1.5 GPa, supply_pressure: 14 MPa, valve_flow: 150 l/min}}
user_effects: [{file}]
effects: {{own_leak: {own}, viscous_friction: {built_in}}}
history: {history}
"""


class Visitor:
    """A model file in a folder, an effect file beside or away from it, and whether that file has been run."""

    def __init__(self, folder: Path) -> None:
        self.trace = folder / "trace"
        self.models, self.elsewhere = folder / "models", folder / "elsewhere"
        for place in (self.models, self.elsewhere):
            place.mkdir()
            (place / "own_leak.py").write_text(EFFECT.format(trace=str(self.trace)))

    def model(self, file: str, own: str = "{}", built_in: str = "{}", history: str = "[]") -> Path:
        path = self.models / "bench.yaml"
        path.write_text(MODEL.format(file=file, own=own, built_in=built_in, history=history))
        return path

    @property
    def ran(self) -> bool:
        return self.trace.exists()


@pytest.fixture
def visitor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Visitor:
    monkeypatch.delenv(VARIABLE, raising=False)
    return Visitor(tmp_path)


def test_a_file_of_the_models_own_folder_runs(visitor: Visitor) -> None:
    assert load_model(visitor.model("own_leak.py")).value("own_leak.coefficient") == 1e-12
    assert visitor.ran


def test_a_file_below_it_runs(visitor: Visitor) -> None:
    (visitor.models / "below").mkdir()
    (visitor.models / "own_leak.py").rename(visitor.models / "below" / "own_leak.py")
    assert "own_leak" in load_model(visitor.model("below/own_leak.py")).effects


@pytest.mark.parametrize("way", ["upwards", "absolute", "link", "linked folder"])
def test_a_file_elsewhere_is_refused_and_does_not_run(visitor: Visitor, way: str) -> None:
    (visitor.models / "link").mkdir()
    (visitor.models / "link" / "own_leak.py").symlink_to(visitor.elsewhere / "own_leak.py")
    (visitor.models / "folder").symlink_to(visitor.elsewhere)
    file = {
        "upwards": "../elsewhere/own_leak.py",
        "absolute": str(visitor.elsewhere / "own_leak.py"),
        "link": "link/own_leak.py",
        "linked folder": "folder/own_leak.py",
    }[way]
    path = visitor.model(file)
    with pytest.raises(ModelError) as caught:
        load_model(path)
    told, folder = str(caught.value), visitor.elsewhere
    assert told.startswith(f"{path}:5: {folder}/own_leak.py is not run: it lies outside the model file's folder ")
    assert f"--trust {folder}" in told and f"{VARIABLE}={folder}" in told and "\n" not in told
    assert not visitor.ran


def test_a_trusted_folder_and_what_is_below_it_run(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    path = visitor.model("../elsewhere/own_leak.py")
    monkeypatch.setenv(VARIABLE, os.pathsep.join([str(visitor.models), str(visitor.elsewhere) + "2"]))
    with pytest.raises(ModelError, match="is not run"):
        load_model(path)
    monkeypatch.setenv(VARIABLE, os.pathsep.join(["/nowhere", str(visitor.elsewhere.parent), ""]))
    assert "own_leak" in load_model(path).effects


def test_a_link_to_the_model_file_leads_to_both_folders(visitor: Visitor) -> None:
    (visitor.elsewhere / "bench.yaml").symlink_to(visitor.model("own_leak.py"))
    assert load_model(visitor.elsewhere / "bench.yaml").user_effects == (visitor.elsewhere / "own_leak.py",)


WRONG = {
    "of a built-in effect": {"built_in": "{coefficient: -1 N*s/m}"},
    "unknown of a built-in effect": {"built_in": "{coeff: 1}"},
    "no quantity": {"own": "{coefficient: much}"},
    "no number": {"own": "{coefficient: [1]}"},
    "no value": {"own": "{coefficient: {source: me}}"},
    "an unknown field": {"own": "{coefficient: {value: 1e-12, valeu: 1}}"},
    "fit": {"own": "{coefficient: {value: 1e-12, fit: maybe}}"},
    "one bound": {"own": "{coefficient: {value: 1e-12, bounds: [0]}}"},
    "bounds of words": {"own": "{coefficient: {value: 1e-12, bounds: [a, b]}}"},
    "an error of words": {"own": "{coefficient: {value: 1e-12, standard_error: small}}"},
    "an effect that is a list": {"own": "[1]"},
    "a history of words": {"history": "[first]"},
    "two files of one name": {"file": "own_leak.py, ./own_leak.py"},
    "a name of the library": {"file": "own_leak.py, end_stop.py"},
    "a second file that is not there": {"file": "own_leak.py, other.py"},
    "no Python": {"file": "own_leak.py, bench.yaml"},
    "no name": {"file": "own_leak.py, [1]"},
    "no name of a file": {"file": 'own_leak.py, "\\0"'},
}


@pytest.mark.parametrize("changes", WRONG.values(), ids=list(WRONG))
def test_nothing_runs_before_all_else_is_in_order(visitor: Visitor, changes: dict[str, str]) -> None:
    (visitor.models / "end_stop.py").write_text(EFFECT.format(trace=str(visitor.trace)))
    path = visitor.model(**{"file": "own_leak.py", **changes})
    with pytest.raises(ModelError, match=rf"^{path}:\d+: "):
        load_model(path)
    assert not visitor.ran


def test_a_file_that_leaves_the_program_is_an_error(visitor: Visitor) -> None:
    (visitor.models / "own_leak.py").write_text("import sys; sys.exit(0)")
    with pytest.raises(ModelError, match=r"own_leak\.py: SystemExit"):
        load_model(visitor.model("own_leak.py"))


def test_the_option_of_a_verb(visitor: Visitor) -> None:
    """In a process of its own: the option holds for the whole process and for those that it starts."""
    path = visitor.model("../elsewhere/own_leak.py")
    program = (
        "import sys, os\nfrom hydraulic_node_utils import cli\nfrom hydraulic_sim import trust, model_file\n"
        "parser = cli.parser('verb', 'verb')\ntrust.add_trust_option(parser)\n"
        "def work(options): model_file.load_model(sys.argv[1]); print(os.environ[trust.VARIABLE])\n"
        "sys.exit(cli.run(parser, work, sys.argv[2:]))\n"
    )

    def run(*options: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", program, str(path), *options]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), VARIABLE: "/nowhere"}
        return subprocess.run(command, capture_output=True, text=True, cwd=visitor.models, env=environment)

    refused = run()
    assert refused.returncode == 2 and "--trust" in refused.stderr and "Traceback" not in refused.stderr
    missing = run("--trust", "nothing")
    assert missing.returncode == 2 and "there is no such folder" in missing.stderr
    assert not visitor.ran
    done = run("--trust", "../elsewhere")
    assert (done.returncode, done.stdout) == (0, f"/nowhere:{visitor.elsewhere}\n"), done.stderr
