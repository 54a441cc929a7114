"""What does not compose is said at the door: with the name, the value and what is allowed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hydraulic_sim import registry
from hydraulic_sim.effect import Effect, Parameter, State
from hydraulic_sim.errors import EffectError, ModelError
from hydraulic_sim.model import Entry, Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sim.registry import library

EFFECT_FILE = """
from hydraulic_sim.effect import Effect, Parameter, State

{body}

EFFECT = Effect(
    slot={slot!r}, summary="a test", kernel=kernel, {more}
    parameters=(Parameter("size", {unit!r}, 1.0, (0.0, 2.0), "size", "made up", null=0.0),),
    equation="F = s", source="made up", excited_by="steps", confused_with=("constant_load",), distinguished_by="-",
)
"""

Write = Callable[..., Path]


@pytest.fixture
def effect_file(tmp_path: Path) -> Write:
    """Writes an effect file: `effect_file(body, slot="force", name="mine", more="")`."""

    def write(body: str, slot: str = "force", name: str = "mine", more: str = "", unit: str = "N") -> Path:
        path = tmp_path / f"{name}.py"
        path.write_text(EFFECT_FILE.format(body=body, slot=slot, more=more, unit=unit), encoding="utf-8")
        return path

    return write


GOOD = "def kernel(velocity, size):\n    return -size * velocity"


def test_a_good_effect_file_joins(effect_file: Write) -> None:
    file = effect_file(GOOD)
    assert library([file])["mine"].slot == "force"
    assert "mine" not in library()


WRONG = {
    "one flow where two are wanted": ("def kernel(size):\n    return size", "flow", "", "wants 2: flow_a, flow_b"),
    "three flows": ("def kernel(size):\n    return size, size, size", "flow", "", "wants 2: flow_a, flow_b"),
    "a tuple where a number is wanted": ("def kernel(size):\n    return (size,)", "force", "", "wants 1: force"),
    "nothing": ("def kernel(size):\n    pass", "force", "", "returns None"),
    "nothing on one way": (
        "def kernel(velocity, size):\n    if velocity > 0.0:\n        return size", "force", "", "returns None"),
    "a text": ("def kernel(size):\n    return 'size'", "force", "", "'size'"),
    "a name that is not defined": ("def kernel(size):\n    return size * GAIN", "force", "", "name 'GAIN'"),
    "an input that nobody gives": (
        "def kernel(velocty, size):\n    return size", "force", "", "asks for 'velocty'.*velocity.*own: size"),
    "a signal before its time": (
        "def kernel(opening, pressure_supply):\n    return opening", "opening", "", "asks for 'pressure_supply'"),
    "a slot that does not exist": (GOOD, "forces", "", "slot 'forces' does not exist; slots: command, .*force"),
    "memory within the right-hand side": (GOOD, "force", "memory=2,", "no place for a memory.*: command"),
    "memory that was not asked for": (
        "def kernel(command, memory, size):\n    return command", "command", "", "asks for 'memory'"),
    "states without dynamics": (GOOD, "force", "states=(State('s', 'm'),),", "states and a dynamics kernel"),
    "dynamics with too few rates": (
        GOOD + "\ndef motion(size):\n    return size", "force",
        "states=(State('s', 'm'), State('r', 'm/s')), dynamics=motion,", r"wants 2: d\(s\)/dt, d\(r\)/dt"),
    "a relaxation state without target": (
        GOOD + "\ndef motion(size):\n    return size", "force",
        "states=(State('s', 'm', kind='relaxation'),), dynamics=motion,", "rate of s, its target"),
    "states in the command": (
        "def kernel(command, s, size):\n    return command\ndef motion(size):\n    return size", "command",
        "states=(State('s', 'm'),), dynamics=motion,", "cannot have states"),
    "use of an unknown parameter": (
        "def kernel(level, size):\n    return level", "force", "uses={'level': 'coulomb_friction.levl'},",
        "coulomb_friction.*'levl'.*it has: level"),
    "use of an unknown effect": (
        "def kernel(level, size):\n    return level", "force", "uses={'level': 'coulomb.level'},",
        "unknown effect 'coulomb'"),
    "what was shown in too short a memory": (
        "def kernel(reading, memory, size):\n    return reading", "position_sensor", "memory=2, begins_shown=True,",
        "with memory 2: it is for a position_sensor with a memory of 3"),
    "what was shown elsewhere": (GOOD, "force", "begins_shown=True,", "begins_shown in slot 'force'"),
    "no Python": ("def kernel(size) return size", "force", "", "SyntaxError"),
    "a unit nobody knows": (GOOD, "force", "unit", "unit 'furlongz'"),
}  # fmt: skip


@pytest.mark.parametrize(("body", "slot", "more", "says"), WRONG.values(), ids=list(WRONG))
def test_a_wrong_effect_file_is_refused_by_name(effect_file: Write, body: str, slot: str, more: str, says: str) -> None:
    changes = {"unit": "furlongz"} if more == "unit" else {"more": more}
    file = effect_file(body, slot, **changes)
    with pytest.raises(EffectError, match=rf"{file}: .*{says}"):
        library([file])


def test_a_parameter_named_like_a_signal_is_refused(effect_file: Write) -> None:
    file = effect_file(GOOD)
    file.write_text(file.read_text().replace('"size"', '"velocity"').replace("(velocity, size)", "(velocity)"))
    with pytest.raises(EffectError, match="'velocity'.*signals or base parameters"):
        library([file])


def test_a_doubled_name_is_refused(effect_file: Write, tmp_path: Path) -> None:
    with pytest.raises(EffectError, match=r"'end_stop' is already defined in .*effects/end_stop\.py"):
        library([effect_file(GOOD, name="end_stop")])
    first = effect_file(GOOD)
    (tmp_path / "other").mkdir()
    second = tmp_path / "other" / "mine.py"
    second.write_bytes(first.read_bytes())
    with pytest.raises(EffectError, match=rf"{second}: .*'mine' is already defined in {first}"):
        library([first, second])
    with pytest.raises(EffectError, match="already defined"):
        library([first, first])


def test_a_file_is_named_when_it_is_missing_or_holds_no_effect(effect_file: Write, tmp_path: Path) -> None:
    with pytest.raises(EffectError, match=r"nowhere\.py: there is no such effect file"):
        library([tmp_path / "nowhere.py"])
    (tmp_path / "empty.py").write_text("X = 1\n")
    with pytest.raises(EffectError, match=r"empty\.py: defines no module constant EFFECT"):
        library([tmp_path / "empty.py"])
    with pytest.raises(EffectError, match=r"not-a-name\.py: .*not a Python identifier"):
        library([effect_file(GOOD, name="not-a-name")])


def test_what_numba_cannot_compile_is_said_with_the_file(effect_file: Write, small_library: Model) -> None:
    body = "def kernel(velocity, size):\n    return float(str(size)) * velocity"
    file = effect_file(body)
    model = replace(small_library, user_effects=(file,)).with_effect("mine")
    with pytest.raises(EffectError, match=rf"do not compile: .*{file}"):
        Plant(model)


def parameter(**changes: object) -> Parameter:
    given = {"name": "size", "unit": "N", "default": 1.0, "bounds": (0.0, 2.0), "description": "d", "source": "s"}
    return Parameter(**(given | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"bounds": (2.0, 0.0)}, "not in rising order"),
        ({"bounds": (0.0, float("nan"))}, "not in rising order"),
        ({"default": 3.0}, "default 3.0 lies outside 0.0…2.0 N"),
        ({"null": -1.0}, "null -1.0 lies outside"),
        ({"name": "two words"}, "not a Python identifier"),
        ({"source": ""}, "names no source"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(EffectError, match=says):
        parameter(**changes)


def test_an_effect_that_contradicts_itself_is_refused() -> None:
    given = {
        "slot": "force", "summary": "s", "kernel": lambda size: size, "parameters": (parameter(null=0.0),),
        "equation": "e", "source": "s", "excited_by": "e", "confused_with": (), "distinguished_by": "t",
    }  # fmt: skip
    Effect(**given)  # type: ignore[arg-type]
    for changes, says in (
        ({"parameters": (parameter(),)}, "no parameter has a null value"),
        ({"parameters": (parameter(null=0.0), parameter())}, "'size'.*twice"),
        ({"excited_by": " "}, "excited_by is empty"),
    ):
        with pytest.raises(EffectError, match=says):
            Effect(**(given | changes))  # type: ignore[arg-type]
    with pytest.raises(EffectError, match="kind 'fast'"):
        State("s", "m", kind="fast")


# --- models ---------------------------------------------------------------------------------------------------


def test_unknown_effects_and_parameters_are_refused_with_the_known_ones(bare: Model) -> None:
    with pytest.raises(ModelError, match=r"unknown effect 'friction'; the library has: backlash, .*viscous_friction"):
        bare.with_effect("friction")
    with pytest.raises(ModelError, match="'coulomb_friction' has no parameter 'force'; it has: level"):
        bare.with_effect("coulomb_friction", {"force": 3.0})
    with pytest.raises(ModelError, match="no parameter 'mass'; it has: moving_mass"):
        bare.value("mass")
    with pytest.raises(ModelError, match="unknown effect 'friction'"):
        Plant(replace(bare, effects=("friction",)))
    with pytest.raises(ModelError, match="backlash is not on; on are: none"):
        bare.without_effect("backlash")
    with pytest.raises(ModelError, match="end_stop is base physics"):
        bare.with_effect("end_stop")


@pytest.mark.parametrize("value", [-1.0, 2e5, float("nan"), float("inf")])
def test_a_value_out_of_bounds_is_refused_with_value_unit_and_bounds(bare: Model, value: float) -> None:
    with pytest.raises(ModelError, match=rf"coulomb_friction\.level: {value:g} N is outside 0 … 100000 N"):
        bare.with_effect("coulomb_friction", {"level": value})


def test_two_laws_of_one_slot_exclude_each_other(effect_file: Write, bare: Model) -> None:
    file = effect_file("def kernel(command, size):\n    return command", slot="spool")
    model = replace(bare, user_effects=(file,)).with_effect("spool_dynamics")
    with pytest.raises(ModelError, match="spool_dynamics and mine are both laws of the slot 'spool'"):
        model.with_effect("mine")
    with pytest.raises(ModelError, match="both laws"):
        Plant(replace(model, effects=("mine", "spool_dynamics")))


def test_an_effect_named_twice_is_refused(bare: Model) -> None:
    with pytest.raises(ModelError, match="constant_load is named twice"):
        Plant(replace(bare, effects=("constant_load", "constant_load")))


def test_a_plant_lacking_values_or_oil_is_refused(bare: Model) -> None:
    entries = {k: v for k, v in bare.entries.items() if k != "stroke"}
    with pytest.raises(ModelError, match="no value for stroke"):
        Plant(replace(bare, entries=entries))
    with pytest.raises(ModelError, match="plant is 'pneumatic'; allowed: hydraulic, mechanical"):
        Plant(replace(bare, kind="pneumatic"))
    motor = Model("motor", {"moving_mass": Entry(2.0), "drive_force": Entry(5.0)}, kind="mechanical")
    assert Plant(motor).simulate([10.0] * 11, 1e-3).velocity[-1] == pytest.approx(0.01 * 50.0 / 2.0)
    with pytest.raises(ModelError, match="internal_leakage acts on the oil"):
        Plant(motor.with_effect("internal_leakage"))


def test_switching_effects_compiles_nothing(bare: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    Plant(bare)
    from hydraulic_sim import compiled

    monkeypatch.setattr(compiled, "write_module", lambda found: pytest.fail("compiled again"))
    Plant(bare.with_effect("spool_dynamics").with_effect("backlash", {"gap": 2e-3}))
    assert registry.library() is registry.library()


def test_a_lean_model_has_what_is_on_and_what_that_uses(effect_file: Write) -> None:
    """It compiles faster, and runs as with the whole library."""
    body = "def kernel(velocity, size, level):\n    return -size * level * velocity"
    mine = effect_file(body, more="uses={'level': 'coulomb_friction.level'},")
    model = replace(load_model("sample_bench"), effects=("viscous_friction",)).with_effect_file(mine)
    lean = replace(model, lean=True)
    assert set(lean.library) == {"end_stop", "viscous_friction", "coulomb_friction", "mine"}
    assert set(lean.with_effect("mine").library) == set(lean.library), "it is there before it is on"
    assert lean.keys() == model.keys() and lean.free_keys() == model.free_keys()
    with pytest.raises(ModelError, match="backlash"):
        lean.with_effect("backlash")
    drive = np.tile([2.0, -1.0], 50)
    bare = replace(load_model("sample_bench"), effects=("viscous_friction",))
    whole, small = (Plant(m).simulate(drive, 1e-3) for m in (bare, replace(bare, lean=True)))
    assert np.array_equal(small.position, whole.position) and np.array_equal(small.pressure_a, whole.pressure_a)
