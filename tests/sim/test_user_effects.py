"""An effect in a file of the user's own joins everything, and what is compiled of it is never stale."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from hydraulic_sim import registry
from hydraulic_sim.batch import scatter
from hydraulic_sim.catalogue import describe
from hydraulic_sim.errors import EffectError
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model, save_model
from hydraulic_sim.plant import Plant
from hydraulic_sim.trust import VARIABLE

LEAK = """
from hydraulic_sim.effect import Effect, Parameter

GAIN = 2.0


def flow(pressure_difference, coefficient):
    q = GAIN * coefficient * pressure_difference
    return -q, q


EFFECT = Effect(
    slot="flow", summary="a leak of our own", kernel=flow,
    parameters=(
        Parameter("coefficient", "m^3/(s*Pa)", 1e-12, (0.0, 1e-9), "leakage", "made up, 2001", null=0.0),
        Parameter("shape", "1", 1.0, (0.0, 2.0), "not used", "made up, 2001", free=False),
    ),
    equation="q = c*PL", source="made up, 2001", excited_by="holding under load",
    confused_with=("internal_leakage",), distinguished_by="-",
)
"""

PROCESS = """
import sys
from pathlib import Path
from hydraulic_sim import registry
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant

registry._BUILTIN[:] = [registry.Library([registry.library().file("end_stop")])]
plant = Plant(load_model(sys.argv[1]))
print(plant.derivative(plant.initial_state(pressure_a=8e6, pressure_b=6e6).states, 0.0)[1]["flow_a"])
"""


class Workshop:
    """A folder with an effect file, a model that names it, and a cache of its own."""

    def __init__(self, folder: Path, model: Model) -> None:
        self.folder = folder
        self.effect = folder / "own_leak.py"
        self.effect.write_text(LEAK)
        with_effect = replace(model, user_effects=(self.effect,)).with_effect("own_leak")
        self.model_file = save_model(with_effect, folder / "bench.yaml")
        self.cache = folder / "cache"

    def edit(self, old: str, new: str) -> None:
        """Change the effect without a trace in size or time of the file, as two saves within a second do."""
        assert len(old) == len(new)
        before = self.effect.stat()
        text = self.effect.read_text()
        assert text.count(old) == 1
        self.effect.write_text(text.replace(old, new))
        os.utime(self.effect, ns=(before.st_atime_ns, before.st_mtime_ns))

    def here(self) -> float:
        """The leak [m³/s] at 2 MPa, in this process."""
        return leak(Plant(load_model(self.model_file)))

    def start(self) -> subprocess.Popen[str]:
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        environment |= {"HYDRAULIC_SIM_CACHE": str(self.cache), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        return subprocess.Popen(
            [sys.executable, "-c", PROCESS, str(self.model_file)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
        )  # fmt: skip

    def compiled(self) -> set[str]:
        return {folder.name for folder in self.cache.iterdir()}


def leak(plant: Plant) -> float:
    return -plant.derivative(plant.initial_state(pressure_a=8e6, pressure_b=6e6).states, 0.0)[1]["flow_a"]


def result(process: subprocess.Popen[str]) -> float:
    output, errors = process.communicate(timeout=500.0)
    assert process.returncode == 0, errors
    return -float(output)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory, bare: Model) -> Iterator[Workshop]:
    with pytest.MonkeyPatch.context() as patch:
        small = registry.Library([registry.library().file("end_stop")])
        patch.setattr(registry, "_BUILTIN", [small])
        folder = tmp_path_factory.mktemp("workshop")
        patch.setenv("HYDRAULIC_SIM_CACHE", str(folder / "cache"))
        entries = {key: entry for key, entry in bare.entries.items() if "." not in key}
        yield Workshop(folder, replace(bare, entries=entries, document=None))


# --- it joins -------------------------------------------------------------------------------------------------


def test_a_user_effect_joins_model_fit_and_catalogue_by_its_file_alone(workshop: Workshop) -> None:
    model = load_model(workshop.model_file)
    assert "own_leak" in model.effects and "own_leak" in model.library
    assert {"own_leak.coefficient", "own_leak.shape"} <= set(model.keys())
    assert "own_leak.coefficient" in model.free_keys() and "own_leak.shape" not in model.free_keys()
    assert model.entry("own_leak.coefficient").bounds == (0.0, 1e-9)
    assert describe(model.library, "own_leak")["file"] == str(workshop.effect)
    assert len({m.value("own_leak.coefficient") for m in scatter(model, {"own_leak.coefficient": 0.1}, 3, 1)}) == 3
    assert "own_leak" not in registry.library()


def test_the_file_is_found_relative_to_the_model_file(
    workshop: Workshop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "user_effects:\n- own_leak.py\n" in workshop.model_file.read_text()
    moved = save_model(load_model(workshop.model_file), tmp_path / "moved.yaml")
    monkeypatch.setenv(VARIABLE, str(workshop.folder))
    assert load_model(moved).user_effects == (workshop.effect,)
    assert f"- {os.path.relpath(workshop.effect, tmp_path)}\n" in moved.read_text()


# --- and is never stale; the tests follow one another, each of them edits the file ----------------------------


def test_an_edit_changes_the_physics_in_the_same_process(workshop: Workshop) -> None:
    old = load_model(workshop.model_file)
    before = Plant(old)
    assert leak(before) == pytest.approx(4e-6, rel=1e-12)
    workshop.edit("q = GAIN * coefficient", "q = GAIN / coefficient")
    workshop.edit("GAIN / coefficient * pressure", "GAIN * coefficient * pressure")
    assert workshop.here() == leak(before)
    workshop.edit("return -q, q", "return q, -q")
    assert workshop.here() == pytest.approx(-4e-6, rel=1e-12)
    assert leak(before) == pytest.approx(4e-6, rel=1e-12), "a plant that runs keeps its physics"
    assert leak(Plant(old)) == pytest.approx(4e-6, rel=1e-12), "and so does a model that was read before"
    assert len(workshop.compiled()) == 2


def test_a_new_process_finds_what_was_compiled(workshop: Workshop) -> None:
    known = workshop.compiled()
    assert result(workshop.start()) == pytest.approx(-4e-6, rel=1e-12)
    assert workshop.compiled() == known


@pytest.mark.thorough
def test_a_changed_constant_reaches_two_processes_compiling_at_once(workshop: Workshop) -> None:
    known = workshop.compiled()
    workshop.edit("GAIN = 2.0", "GAIN = 3.0")
    both = [workshop.start(), workshop.start()]
    assert [result(process) for process in both] == pytest.approx([-6e-6, -6e-6], rel=1e-12)
    assert len(workshop.compiled() - known) == 1
    assert not list(workshop.cache.rglob(".*"))


@pytest.mark.thorough
def test_a_damaged_cache_is_made_anew(workshop: Workshop) -> None:
    binaries = [f for f in workshop.cache.rglob("*") if f.suffix in (".nbi", ".nbc")]
    assert binaries, "nothing was cached"
    for i, file in enumerate(binaries):
        content = file.read_bytes()
        file.write_bytes(content[: len(content) // 2] if i % 2 else bytes(len(content)))
    assert result(workshop.start()) == pytest.approx(-6e-6, rel=1e-12)
    for text in workshop.cache.rglob("plant_*.py"):
        text.write_text("")
    assert result(workshop.start()) == pytest.approx(-6e-6, rel=1e-12)


def test_a_name_that_no_file_can_have_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(EffectError, match="too long"):
        registry.check_file(tmp_path / f"{300 * 'a'}.py")
