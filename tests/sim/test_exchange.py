"""Models that travel: a plant in C and as an FMU is the plant itself, sample by sample; FMUs of others are run."""

from __future__ import annotations

import shutil
import subprocess
import xml.etree.ElementTree as Xml
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.validation import validate_fmu

from hydraulic_sim import base
from hydraulic_sim.errors import EffectError, ExchangeError
from hydraulic_sim.exchange.fmu import compiler, write_fmu
from hydraulic_sim.exchange.foreign import ForeignFmu
from hydraulic_sim.exchange.plant_source import plant_source
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sim.verbs import export

RATE = 1000.0
pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler (cc, gcc or clang) on this machine")


def multisine(seconds: float, seed: int = 3) -> np.ndarray:
    t = np.arange(round(seconds * RATE)) / RATE
    rng = np.random.default_rng(seed)
    f = np.arange(1, 25) * 0.5
    u = (np.sin(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, f.size)) / np.sqrt(f)).sum(axis=1)
    return 6.0 * u / np.abs(u).max()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "bench.fmu"
    assert write_fmu(load_model("sample_bench"), path, RATE) in ("linux64", "aarch64-linux")
    return path


def test_fmu_is_the_plant_sample_by_sample(made: Path) -> None:
    drive = multisine(20.0)
    truth = Plant(load_model("sample_bench")).simulate(drive, 1.0 / RATE)
    found = ForeignFmu(made).simulate(drive, 1.0 / RATE)
    assert np.ptp(truth["position"]) > 0.02
    assert np.abs(found["position"] - truth["position"]).max() <= 1e-6 * np.ptp(truth["position"])
    for name in found:
        assert np.abs(found[name] - truth[name]).max() <= 1e-6 * max(np.ptp(truth[name]), 1e-6), name


def test_fmu_without_dry_friction_agrees_to_a_billionth(tmp_path: Path) -> None:
    model = load_model("sample_bench").without_effect("coulomb_friction")
    write_fmu(model, tmp_path / "smooth.fmu", RATE)
    drive = multisine(20.0)
    truth = Plant(model).simulate(drive, 1.0 / RATE)["position"]
    found = ForeignFmu(tmp_path / "smooth.fmu").simulate(drive, 1.0 / RATE)["position"]
    assert np.abs(found - truth).max() <= 1e-9 * np.ptp(truth)


def test_fmu_is_valid_and_the_same_each_time(made: Path, tmp_path: Path) -> None:
    assert validate_fmu(str(made)) == []
    write_fmu(load_model("sample_bench"), tmp_path / "again.fmu", RATE)
    with zipfile.ZipFile(made) as a, zipfile.ZipFile(tmp_path / "again.fmu") as b:
        assert a.namelist() == b.namelist()
        for name in a.namelist():
            if not name.startswith("binaries"):
                assert a.read(name) == b.read(name)
        assert str(Path.home()).encode() not in b"".join(a.read(n) for n in a.namelist())


def test_every_effect_of_the_library_is_the_same_in_c(tmp_path: Path, everything: Model) -> None:
    everything = everything.with_values({"command_delay.delay": 2.3 / RATE})  # ends within a sample
    drive = multisine(10.0)
    write_fmu(everything, tmp_path / "all.fmu", RATE)
    truth = Plant(everything).simulate(drive, 1.0 / RATE)
    found = ForeignFmu(tmp_path / "all.fmu").simulate(drive, 1.0 / RATE)
    for name in found:
        span = max(np.ptp(truth[name]), 1e-6)
        assert np.abs(found[name] - truth[name]).max() <= 1e-6 * span, name


def test_sources_compile_without_a_warning_and_without_python(tmp_path: Path, everything: Model) -> None:
    for name, text in plant_source(everything, RATE).files.items():
        assert "Python.h" not in text
        (tmp_path / name).write_text(text)
    command = [
        str(compiler()),
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-O1",
        "-fPIC",
        "-shared",
        "plant.c",
        "-o",
        "plant.so",
        "-lm",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


class Unit:
    """An FMU instance by FMPy, with what it says."""

    def __init__(self, path: Path, folder: Path) -> None:
        known = fmpy.read_model_description(str(path))
        self.at = {v.name: v.valueReference for v in known.modelVariables}
        fmpy.extract(str(path), unzipdir=str(folder))
        self.unit = FMU2Slave(
            guid=known.guid, unzipDirectory=str(folder), instanceName="u",
            modelIdentifier=known.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.unit.instantiate()

    def start(self, **parameters: float) -> None:
        self.unit.setupExperiment(startTime=0.0)
        for name, value in parameters.items():
            self.set(name.replace("__", "."), value)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def set(self, name: str, value: float) -> None:
        self.unit.setReal([self.at[name]], [value])

    def get(self, name: str) -> float:
        return self.unit.getReal([self.at[name]])[0]


def test_fmu_starts_where_and_with_what_it_is_told(made: Path, tmp_path: Path) -> None:
    u = Unit(made, tmp_path)
    model = load_model("sample_bench").with_values({"moving_mass": 321.0})
    plant = Plant(model)
    u.start(initial__position=0.01, moving_mass=321.0, longest_step=plant.longest_step)
    assert u.get("position") == u.get("true_position") == 0.01
    drive = np.full(100, 2.0)
    truth = plant.simulate(drive, 1e-3, plant.initial_state(position=0.01))
    u.set("drive", 2.0)
    for k in range(99):
        u.unit.doStep(k * 1e-3, 1e-3)
    assert u.get("position") == pytest.approx(truth["position"][-1], abs=1e-9)


def test_fmu_goes_back_to_a_state_it_gave(made: Path, tmp_path: Path) -> None:
    u = Unit(made, tmp_path)
    u.start()
    u.set("drive", 3.0)
    u.unit.doStep(0.0, 0.05)
    kept = u.unit.getFMUState()
    packed = u.unit.serializeFMUstate(kept)
    u.unit.doStep(0.05, 0.05)
    first = u.get("position")
    for again in (kept, u.unit.deSerializeFMUstate(packed)):
        u.unit.setFMUState(again)
        u.unit.doStep(0.05, 0.05)
        assert u.get("position") == first
    u.unit.reset()
    u.start()
    assert u.get("position") == 0.0


@pytest.mark.parametrize("step", [0.0005, 0.00123, 0.0, -0.001, float("nan"), float("inf")])
def test_fmu_refuses_a_step_that_is_no_whole_number_of_samples(made: Path, tmp_path: Path, step: float) -> None:
    u = Unit(made, tmp_path)
    u.start()
    with pytest.raises(Exception, match="fmi2DoStep"):
        u.unit.doStep(0.0, step)


def test_fmu_refuses_values_that_it_cannot_have(made: Path, tmp_path: Path) -> None:
    u = Unit(made, tmp_path)
    with pytest.raises(Exception, match="fmi2SetReal"):
        u.set("moving_mass", -1.0)
    with pytest.raises(Exception, match="fmi2SetReal"):
        u.set("position", 0.1)
    with pytest.raises(Exception, match="fmi2SetReal"):
        u.set("drive", float("nan"))
    with pytest.raises(Exception, match="fmi2GetReal"):
        u.unit.getReal([99999])
    u.start()
    with pytest.raises(Exception, match="fmi2SetReal"):
        u.set("moving_mass", 100.0)  # fixed by now
    with pytest.raises(Exception, match="fmi2DoStep"):
        u.unit.doStep(0.5, 1e-3)  # the plant is at 0


def test_without_a_compiler_there_are_sources_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _: None)
    assert write_fmu(load_model("sample_bench"), tmp_path / "a.fmu", RATE) is None
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        assert not [n for n in archive.namelist() if n.startswith("binaries")]
        assert "sources/plant.c" in archive.namelist()


def test_export_writes_and_never_replaces(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export.main(["--model", "sample_bench", "--fmu", str(tmp_path / "a.fmu"), "--rate", "500"]) == 0
    assert "500 Hz" in capsys.readouterr().out
    before = (tmp_path / "a.fmu").read_bytes()
    assert export.main(["--model", "sample_bench", "--fmu", str(tmp_path / "a.fmu")]) == 2
    assert (tmp_path / "a.fmu").read_bytes() == before
    assert export.main(["--model", "sample_bench", "--c", str(tmp_path / "c")]) == 0
    assert sorted(f.name for f in (tmp_path / "c").iterdir()) == ["plant.c", "plant.h"]
    assert export.main(["--model", "no_such", "--c", str(tmp_path / "d")]) == 2
    assert not (tmp_path / "d").exists()


def test_rate_too_slow_or_too_fast_is_told(tmp_path: Path) -> None:
    model = load_model("sample_bench").with_effect("command_delay", {"delay": 0.02})
    with pytest.raises(Exception, match="memory of a delay"):
        plant_source(model, 1e6)


def test_effect_that_c_cannot_be_written_of_is_named(tmp_path: Path, small_library: Model) -> None:
    file = tmp_path / "odd_friction.py"
    text = PIECE.replace("import math\n", "import math\n\nimport numpy\n")
    file.write_text(text.replace("math.tanh(velocity)", "numpy.cbrt(velocity)"))
    model = small_library.with_effect_file(file).with_effect("odd_friction")
    with pytest.raises(EffectError, match="odd_friction.*cannot be written in C"):
        plant_source(model, RATE)


def renamed(made: Path, target: Path, changes: dict[str, dict[str, str]], version: str | None = None) -> Path:
    """The FMU as another tool would have written it: other names and units of variables."""
    with zipfile.ZipFile(made) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                root = Xml.fromstring(content)
                if version:
                    root.set("fmiVersion", version)
                for variable in root.iter("ScalarVariable"):
                    for key, value in changes.get(str(variable.get("name")), {}).items():
                        (variable if key == "name" else variable.find("Real")).set(key, value)
                for unit in {c["unit"] for c in changes.values() if "unit" in c}:
                    Xml.SubElement(root.find("UnitDefinitions"), "Unit", name=unit)
                content = Xml.tostring(root)
            new.writestr(name, content)
    return target


def test_foreign_names_and_units_are_followed(made: Path, tmp_path: Path) -> None:
    other = renamed(made, tmp_path / "b.fmu", {"drive": {"name": "u"}, "position": {"name": "rod.s", "unit": "mm"}})
    drive = multisine(1.0)
    found = ForeignFmu(other, {"drive": "u", "position": "rod.s"}).simulate(drive, 1e-3)
    own = ForeignFmu(made).simulate(drive, 1e-3)
    assert np.allclose(found["position"], 1e-3 * own["position"], rtol=1e-12)


@pytest.mark.parametrize(
    "names, changes, version, match",
    [
        ({}, {"drive": {"name": "u"}}, None, "no variable is called 'drive'.*u"),
        ({"position": "x"}, {}, None, "no variable 'x' for position"),
        ({"speed": "velocity"}, {}, None, "'speed'.*allowed: drive"),
        ({}, {"position": {"unit": "K"}}, None, "position"),
        ({}, {}, "3.0", "read|FMI 3.0"),
    ],
)
def test_foreign_fmu_that_does_not_fit_is_refused(
    made: Path, tmp_path: Path, names: dict, changes: dict, version: str | None, match: str
) -> None:
    other = renamed(made, tmp_path / "b.fmu", changes, version)
    with pytest.raises(ExchangeError, match=match):
        ForeignFmu(other, names)


def test_what_is_no_fmu_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.fmu").write_text("nothing")
    with pytest.raises(ExchangeError, match="no FMU"):
        ForeignFmu(tmp_path / "a.fmu")


def test_foreign_fmu_that_fails_says_why(made: Path) -> None:
    with pytest.raises(ExchangeError, match="whole multiple of 0.001"):
        ForeignFmu(made).simulate(np.zeros(10), 0.0003)


def test_the_working_folder_stays(made: Path, tmp_path: Path) -> None:
    """FMPy changes it while it loads a library, and stays there where that fails."""
    before, fmu = Path.cwd(), ForeignFmu(made)
    with ThreadPoolExecutor(4) as pool:
        runs = list(pool.map(lambda seed: fmu.simulate(multisine(0.2, seed), 1e-3)["position"], [1, 1, 2, 2] * 4))
    assert Path.cwd() == before
    assert all(np.array_equal(a, b) for a, b in zip(runs[::2], runs[1::2], strict=True))
    with zipfile.ZipFile(made) as old, zipfile.ZipFile(tmp_path / "b.fmu", "w") as new:
        for name in old.namelist():
            new.writestr(name, b"no library" if name.startswith("binaries") else old.read(name))
    with pytest.raises(ExchangeError, match="fails"):
        ForeignFmu(tmp_path / "b.fmu").simulate(np.zeros(5), 1e-3)
    assert Path.cwd() == before


def test_value_references_match_the_c_side(made: Path) -> None:
    """Every output of the FMU is the plant's output of that name (the order stands in two languages)."""
    drive = np.full(200, 2.5)
    truth = Plant(load_model("sample_bench")).simulate(drive, 1e-3)
    found = fmpy.simulate_fmu(
        str(made), stop_time=0.199, step_size=1e-3, output_interval=1e-3, output=list(base.OUTPUTS),
        start_values={"drive": 2.5},
    )  # fmt: skip
    for name in base.OUTPUTS:
        assert found[name][-1] == pytest.approx(truth[name][-1], rel=1e-9, abs=1e-12), name


def test_an_effect_of_the_users_own_is_exported_too(tmp_path: Path, small_library: Model) -> None:
    file = Path(__file__).parents[2] / "examples" / "user_effects" / "seal_drag.py"
    model = small_library.with_effect_file(file).with_effect("seal_drag")
    write_fmu(model, tmp_path / "own.fmu", RATE)
    drive = multisine(4.0)
    truth = Plant(model).simulate(drive, 1.0 / RATE)["position"]
    without = Plant(model.without_effect("seal_drag")).simulate(drive, 1.0 / RATE)["position"]
    found = ForeignFmu(tmp_path / "own.fmu").simulate(drive, 1.0 / RATE)["position"]
    assert np.abs(truth - without).max() > 1e-5  # it matters
    assert np.abs(found - truth).max() <= 1e-6 * np.ptp(truth)


PIECE = """
import math

from hydraulic_sim.effect import Effect, Parameter

STEEP = True


def force(velocity, level):
    count = 3
    head = 0
    total = 0
    for i in range(count):
        count = 1
        i += 10
        head -= 2
        total += head % 5 + i
    half = 3
    half /= 2
    any_left = 0
    if velocity > 0.0:
        any_left = 1
    return -level * math.tanh(velocity) * (total + half + any_left + STEEP)


EFFECT = Effect(
    name="odd_friction", slot="force", summary="s", kernel=force,
    parameters=(Parameter("level", "N", 20.0, (0.0, 1e6), "d", "s", null=0.0),),
    equation="e", source="s", excited_by="x", confused_with=("end_stop",), distinguished_by="y",
)
"""


def test_what_python_and_c_do_otherwise_is_done_as_in_python(tmp_path: Path, small_library: Model) -> None:
    """A loop's bound and counter, remainders of negative numbers, division of whole ones, a flag that changes."""
    (tmp_path / "odd_friction.py").write_text(PIECE)
    model = small_library.with_effect_file(tmp_path / "odd_friction.py").with_effect("odd_friction")
    write_fmu(model, tmp_path / "odd.fmu", RATE)
    drive = multisine(3.0)
    truth = Plant(model).simulate(drive, 1.0 / RATE)["position"]
    without = Plant(model.without_effect("odd_friction")).simulate(drive, 1.0 / RATE)["position"]
    found = ForeignFmu(tmp_path / "odd.fmu").simulate(drive, 1.0 / RATE)["position"]
    assert np.abs(truth - without).max() > 1e-5
    assert np.abs(found - truth).max() <= 1e-9 * np.ptp(truth)


def test_a_loop_with_an_else_is_refused(tmp_path: Path, small_library: Model) -> None:
    looped = "    while head > 9:\n        head -= 1\n    else:\n        head = 4\n    half = 3\n"
    (tmp_path / "odd_friction.py").write_text(PIECE.replace("    half = 3\n", looped))
    model = small_library.with_effect_file(tmp_path / "odd_friction.py").with_effect("odd_friction")
    with pytest.raises(EffectError, match="While cannot be written in C"):
        plant_source(model, RATE)
