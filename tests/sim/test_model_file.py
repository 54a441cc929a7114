"""Model files: read with the place of every error, saved with comments, digits and history kept."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hydraulic_sim.errors import ModelError
from hydraulic_sim.model import Entry, Model
from hydraulic_sim.model_file import load_model, presets, save_model
from hydraulic_sim.plant import Plant

BENCH = """\
# My bench, third floor
format: hydraulic-model-1   # of this package
name: bench
description: as built
plant: hydraulic
# geometry first
parameters:
  moving_mass: 500 kg   # with the fixture
  piston_area_a: 12.5 in^2
  piston_area_b: {value: 12.5 in^2, source: drawing 7}  # rod side
  stroke: 60 in
  # volumes with hoses
  dead_volume_a: 18.6 in^3
  dead_volume_b: 18.6 in^3
  bulk_modulus: {value: 22e4 psi, source: data sheet, fit: free, bounds: [15e4 psi, 25e4 psi]}
  supply_pressure: 2000 psi
  valve_flow: 40 gal/min
effects:
  coulomb_friction:   # dry
    level: {value: 450 N, source: guess, fit: free, bounds: [0 N, 2000 N], standard_error: 12 N, note: to be measured}
  spool_dynamics: {}  # as the data sheet has it
  end_stop:
    stiffness: 6e8 N/m
# what happened to it
history:
- what: first   # by hand
  error: 3.5
# the end
"""

Write = Callable[[str], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def put(text: str) -> Path:
        path = tmp_path / "bench.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return put


def changed(old: str, new: str) -> str:
    assert BENCH.count(old) == 1, old
    return BENCH.replace(old, new)


def lines_changed(before: str, after: str) -> tuple[list[str], list[str]]:
    """Lines that went and lines that came."""
    old, new = before.splitlines(), after.splitlines()
    return [line for line in old if line not in new], [line for line in new if line not in old]


# --- reading --------------------------------------------------------------------------------------------------


def test_values_are_read_into_si_with_what_is_said_about_them(write: Write) -> None:
    model = load_model(write(BENCH))
    assert (model.name, model.description, model.kind) == ("bench", "as built", "hydraulic")
    assert model.value("piston_area_a") == pytest.approx(8.0645e-3)
    assert model.value("bulk_modulus") == pytest.approx(1.51684660e9)
    assert model.value("moving_mass") == 500.0
    assert model.value("spool_dynamics.frequency") == 80.0
    assert model.effects == ("coulomb_friction", "spool_dynamics")
    entry = model.entry("coulomb_friction.level")
    assert entry == Entry(450.0, "guess", True, (0.0, 2000.0), 12.0, None, "to be measured")
    assert model.entry("bulk_modulus").bounds == pytest.approx((15e4 * 6894.757293168, 25e4 * 6894.757293168))
    assert model.entry("stroke").free is False and model.entry("moving_mass").free is True
    assert model.entry("spool_dynamics.damping").source.startswith("library default: ")
    assert model.history == ({"what": "first", "error": 3.5},)
    assert model.path is not None and model.path.name == "bench.yaml"


def test_free_and_fixed(write: Write) -> None:
    text = changed("moving_mass: 500 kg ", "moving_mass: {value: 500 kg, fit: fixed} ").replace(
        "stroke: 60 in", "stroke: {value: 60 in, fit: free}"
    )
    free = load_model(write(text)).free_keys()
    assert "moving_mass" not in free and "stroke" in free
    assert {"coulomb_friction.level", "spool_dynamics.frequency", "bulk_modulus"} <= set(free)
    assert not any(key.startswith(("backlash.", "viscous_friction.")) for key in free), "effects that are off"


WRONG: dict[str, tuple[str, int, tuple[str, ...]]] = {
    "an unknown parameter": (
        changed("moving_mass: 500 kg ", "moving_mas: 500 kg "), 8, ("'moving_mas'", "it has: moving_mass, ")),
    "a value out of bounds": (
        changed("moving_mass: 500 kg ", "moving_mass: -5 kg "), 8, ("moving_mass: -5 kg", "0.001 … 1e+06 kg")),
    "a unit of another kind": (
        changed("stroke: 60 in", "stroke: 60 psi"), 11, ("stroke: '60 psi'", "does not convert to m")),
    "a decimal comma": (changed("500 kg ", "0,5 t "), 8, ("moving_mass: '0,5 t' is not a quantity", "'1.5 kg'")),
    "no value": (changed("moving_mass: 500 kg ", "moving_mass: "), 8, ("moving_mass: None is not a number",)),
    "a field nobody knows": (
        changed("fit: free, bounds: [15e4", "fits: free, bounds: [15e4"), 15, ("'fits'", "allowed: value, source")),
    "an entry without value": (changed("{value: 12.5 in^2, source", "{source"), 10, ("piston_area_b: no value",)),
    "fit neither free nor fixed": (
        changed("data sheet, fit: free", "data sheet, fit: maybe"), 15, ("'maybe'", "free, fixed")),
    "bounds the wrong way": (
        changed("[15e4 psi, 25e4 psi]", "[25e4 psi, 15e4 psi]"), 15, ("bulk_modulus: bounds", "not in order")),
    "bounds beyond the library's": (
        changed("[15e4 psi, 25e4 psi]", "[15e4 psi, 25e9 psi]"), 15, ("bulk_modulus: bounds", "1e+07 … 4e+09 Pa")),
    "one bound": (changed("[15e4 psi, 25e4 psi]", "[15e4 psi]"), 15, ("expected [lowest, highest]",)),
    "a value outside its own bounds": (
        changed("value: 22e4 psi", "value: 26e4 psi"), 15, ("bulk_modulus: 1.79264e+09 Pa is outside its bounds",)),
    "an unknown effect": (
        changed("coulomb_friction:   # dry", "coulomb:   # dry"), 19,
        ("unknown effect 'coulomb'", "coulomb_friction, ", "viscous_friction")),
    "an unknown parameter of an effect": (
        changed("level: {value: 450", "force: {value: 450"), 20, ("no parameter 'force'", "it has: level")),
    "an effect that is a number": (
        changed("spool_dynamics: {}", "spool_dynamics: 80"), 21, ("spool_dynamics: expected a mapping", "80")),
    "effects as a list": (changed("spool_dynamics: {} ", "spool_dynamics: [1] "), 21, ("expected a mapping",)),
    "parameters as a text": (
        BENCH[: BENCH.index("  moving_mass")].replace("parameters:", "parameters: none"), 7,
        ("parameters: expected a mapping, found 'none'",)),
    "a key nobody knows": (changed("description: ", "descripton: "), 4, ("'descripton'", "allowed: format, name")),
    "a doubled key": (changed("  stroke: 60 in", "  stroke: 60 in\n  stroke: 61 in"), 12, ('duplicate key "stroke"',)),
    "another format": (changed("model-1", "model-9"), 2, ("'hydraulic-model-9'; expected 'hydraulic-model-1'",)),
    "another plant": (changed("plant: hydraulic", "plant: pneumatic"), 5, ("'pneumatic'", "hydraulic, mechanical")),
    "an effect file that is not there": (
        BENCH + "user_effects: [mine.py]\n", 29, ("mine.py: there is no such effect file",)),
    "an effect file as a text": (BENCH + "user_effects: mine.py\n", 29, ("user_effects: expected a list",)),
    "a history of words": (
        changed("- what: first   # by hand\n  error: 3.5", "- first"), 25, ("expected mappings, found 'first'",)),
    "a history as a text": (
        changed("history:\n- what: first   # by hand\n  error: 3.5", "history: long"), 25, ("expected a list",)),
    "no YAML": (changed("{value: 22e4 psi", "{value: 22e4 psi]"), 15, ("not valid YAML",)),
}  # fmt: skip


@pytest.mark.parametrize(("text", "line", "says"), WRONG.values(), ids=list(WRONG))
def test_an_error_names_file_line_key_and_what_is_allowed(
    write: Write, text: str, line: int, says: tuple[str, ...]
) -> None:
    path = write(text)
    with pytest.raises(ModelError) as caught:
        load_model(path)
    message = str(caught.value)
    assert message.startswith(f"{path}:{line}: "), message
    for part in says:
        assert part in message, message
    assert "\n" not in message


def test_what_is_missing_altogether_names_the_file(write: Write, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"bench\.yaml: no value for stroke \(required for a hydraulic plant\)"):
        load_model(write(changed("  stroke: 60 in\n", "")))
    for text in ("", "- a\n- b\n", "just words"):
        with pytest.raises(ModelError, match=r"bench\.yaml: the file holds no mapping"):
            load_model(write(text))
    with pytest.raises(ModelError, match=r"nothing\.yaml: no such model file; presets: .*sample_bench"):
        load_model(tmp_path / "nothing.yaml")
    with pytest.raises(ModelError, match="no such model file"):
        load_model(tmp_path)
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ModelError, match=r"binary\.yaml: not a text file"):
        load_model(tmp_path / "binary.yaml")


@pytest.mark.parametrize("name", presets())
def test_a_preset_loads_runs_and_is_kept_word_for_word(name: str, tmp_path: Path) -> None:
    model = load_model(name)
    run = Plant(model).simulate(2.0 * np.sin(np.arange(300) * 0.05), 1e-3)
    assert np.all(np.isfinite(run.position))
    saved = save_model(model, tmp_path / "copy.yaml")
    assert load_model(saved).entries == model.entries
    comments = [line.strip() for line in presets()[name].read_text("utf-8").splitlines() if "#" in line]
    text = saved.read_text("utf-8")
    assert all(comment[comment.index("#") :] in text for comment in comments)


# --- saving ---------------------------------------------------------------------------------------------------


def test_an_unchanged_model_is_written_as_it_was_read(write: Write, tmp_path: Path) -> None:
    saved = save_model(load_model(write(BENCH)), tmp_path / "saved.yaml")
    assert saved.read_text("utf-8") == BENCH


def test_only_what_changed_is_written_anew(write: Write, tmp_path: Path) -> None:
    model = load_model(write(BENCH)).with_values({"moving_mass": 510.0, "bulk_modulus": 1.4e9})
    text = save_model(model, tmp_path / "saved.yaml").read_text("utf-8")
    went, came = lines_changed(BENCH, text)
    assert len(went) == len(came) == 2
    assert "moving_mass: 510 kg" in came[0] and "# with the fixture" in came[0]
    assert "value: 1400000000 Pa, fit: free, bounds: [15e4 psi, 25e4 psi]" in came[1]


def test_effects_come_and_go_and_comments_of_others_stay(write: Write, tmp_path: Path) -> None:
    model = load_model(write(BENCH))
    less = save_model(model.without_effect("spool_dynamics"), tmp_path / "less.yaml")
    went, came = lines_changed(BENCH, less.read_text("utf-8"))
    assert went == ["  spool_dynamics: {}  # as the data sheet has it"] and came == []
    none = save_model(model.without_effect("spool_dynamics").without_effect("coulomb_friction"), tmp_path / "none.yaml")
    assert load_model(none).effects == ()
    assert "# what happened to it" in none.read_text("utf-8") and "# the end" in none.read_text("utf-8")
    more = save_model(model.with_effect("backlash", {"gap": 2e-3}), tmp_path / "more.yaml")
    went, came = lines_changed(BENCH, more.read_text("utf-8"))
    assert went == [] and [line.strip() for line in came] == ["backlash:", "gap: 0.002 m"]
    assert load_model(more).effects == ("coulomb_friction", "spool_dynamics", "backlash")


def test_a_comment_behind_the_last_effect_that_goes_stays(write: Write, tmp_path: Path) -> None:
    text = changed("  end_stop:\n    stiffness: 6e8 N/m\n", "")
    model = load_model(write(text)).without_effect("spool_dynamics")
    saved = save_model(model, tmp_path / "saved.yaml").read_text("utf-8")
    assert "# what happened to it" in saved and "as the data sheet" not in saved
    alone = load_model(save_model(model, tmp_path / "alone.yaml")).without_effect("coulomb_friction")
    last = save_model(alone, tmp_path / "last.yaml")
    assert "# what happened to it" in last.read_text("utf-8")
    assert load_model(last).effects == ()


def test_values_of_an_effect_that_is_off_do_not_switch_it_on(write: Write, tmp_path: Path) -> None:
    model = load_model(write(BENCH)).with_values({"backlash.gap": 2e-3})
    assert load_model(save_model(model, tmp_path / "saved.yaml")).effects == model.effects


def test_an_effect_off_and_on_again_has_the_defaults_also_in_the_file(write: Write, tmp_path: Path) -> None:
    model = load_model(write(changed("value: 450 N", "value: 600 N")))
    again = model.without_effect("coulomb_friction").with_effect("coulomb_friction")
    assert again.value("coulomb_friction.level") == 450.0
    assert load_model(save_model(again, tmp_path / "saved.yaml")).value("coulomb_friction.level") == 450.0


def test_what_is_said_of_a_value_can_be_unsaid(write: Write, tmp_path: Path) -> None:
    model = load_model(write(BENCH)).with_entry("coulomb_friction.level", standard_error=None, note=None, free=False)
    entry = load_model(save_model(model, tmp_path / "saved.yaml")).entry("coulomb_friction.level")
    assert (entry.standard_error, entry.note, entry.free, entry.source) == (None, None, False, "guess")


def test_a_value_that_changes_takes_its_source_and_loses_its_error(write: Write) -> None:
    model, key = load_model(write(BENCH)), "coulomb_friction.level"
    assert model.with_values({key: 450.0}).entry(key) == model.entry(key)
    by_hand, fitted = model.with_values({key: 460.0}), model.with_values({key: 460.0}, source="fit of bag_7")
    assert (by_hand.entry(key).source, by_hand.entry(key).standard_error) == ("", None)
    assert (fitted.entry(key).source, fitted.entry(key).standard_error) == ("fit of bag_7", None)
    assert fitted.entry(key).bounds == model.entry(key).bounds and fitted.entry(key).note == "to be measured"


def test_a_value_beyond_its_bounds_may_be_simulated_but_not_saved(write: Write, tmp_path: Path) -> None:
    """Bounds say how far a fit may go; a file that contradicts itself is neither written nor read."""
    model = load_model(write(BENCH)).with_values({"coulomb_friction.level": 2500.0})
    assert Plant(model).value("coulomb_friction.level") == 2500.0
    with pytest.raises(ModelError, match=r"coulomb_friction\.level: 2500 N is outside its bounds 0 … 2000 N"):
        save_model(model, tmp_path / "saved.yaml")
    wider = model.with_entry("coulomb_friction.level", bounds=(0.0, 3000.0))
    assert load_model(save_model(wider, tmp_path / "saved.yaml")).value("coulomb_friction.level") == 2500.0


def test_history_grows_and_keeps_its_comments(write: Write, tmp_path: Path) -> None:
    model = load_model(write(BENCH)).with_history(
        record="bag_7", error_before=np.float64(0.2), error_after=0.1, free=("moving_mass",), steps=np.arange(2)
    )
    path = save_model(model, tmp_path / "saved.yaml")
    went, _ = lines_changed(BENCH, path.read_text("utf-8"))
    assert went == []
    assert load_model(path).history == (
        {"what": "first", "error": 3.5},
        {"record": "bag_7", "error_before": 0.2, "error_after": 0.1, "free": ["moving_mass"], "steps": [0, 1]},
    )
    twice = save_model(load_model(path).with_history(what="third"), tmp_path / "twice.yaml")
    assert [h.get("what") for h in load_model(twice).history] == ["first", None, "third"]
    fresh = load_model("sample_bench").with_history(what="first")
    assert load_model(save_model(fresh, tmp_path / "fresh.yaml")).history == ({"what": "first"},)


def test_a_history_that_no_file_can_hold_is_refused(write: Write, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="cannot represent an object"):
        save_model(load_model(write(BENCH)).with_history(plant=object()), tmp_path / "saved.yaml")
    assert [f.name for f in tmp_path.iterdir()] == ["bench.yaml"]


def test_a_model_made_in_python_is_saved_and_read(tmp_path: Path, bare: Model) -> None:
    made = replace(bare.with_effect("stribeck_friction", {"rise": 123.4}), name="made", document=None, path=None)
    again = load_model(save_model(made, tmp_path / "made.yaml"))
    assert again.name == "made" and again.effects == made.effects
    assert {k: again.value(k) for k in made.keys()} == {k: made.value(k) for k in made.keys()}  # noqa: SIM118


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mass=st.floats(1e-3, 1e6), level=st.floats(0.0, 2000.0), leak=st.floats(0.0, 1e-9), data=st.data())
def test_any_values_survive_saving_bit_for_bit(
    tmp_path: Path, mass: float, level: float, leak: float, data: st.DataObject
) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text(BENCH, "utf-8")
    values = {"moving_mass": mass, "coulomb_friction.level": level, "internal_leakage.coefficient": leak}
    model = load_model(path).with_effect("internal_leakage").with_values(values, source="fit 3")
    error = data.draw(st.none() | st.floats(0.0, 1e3))
    model = model.with_entry("coulomb_friction.level", standard_error=error, bounds=(0.0, 1e5))
    again = load_model(save_model(model, tmp_path / "again.yaml", overwrite=True))
    assert again.entries == model.entries
    assert again.effects == model.effects and again.history == model.history


# --- the file itself ------------------------------------------------------------------------------------------


def test_nothing_is_overwritten_silently(write: Write, tmp_path: Path) -> None:
    path = write(BENCH)
    model = load_model(path)
    with pytest.raises(ModelError, match=r"bench\.yaml exists; give another name"):
        save_model(model.with_values({"moving_mass": 1.0}), path)
    assert path.read_text("utf-8") == BENCH
    save_model(model.with_values({"moving_mass": 1.0}), path, overwrite=True)
    assert load_model(path).value("moving_mass") == 1.0
    assert [f.name for f in tmp_path.iterdir()] == ["bench.yaml"], "temporary files are left"


def test_a_file_appears_whole_or_not_at_all(write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = load_model(write(BENCH))

    def full(*_: object) -> None:
        raise OSError("no space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        for target, overwrite in ((tmp_path / "bench.yaml", True),):
            with pytest.raises(OSError, match="no space"):
                save_model(model.with_values({"moving_mass": 1.0}), target, overwrite)
    assert (tmp_path / "bench.yaml").read_text("utf-8") == BENCH
    assert [f.name for f in tmp_path.iterdir()] == ["bench.yaml"]


def test_others_may_read_what_is_saved(write: Write, tmp_path: Path) -> None:
    saved = save_model(load_model(write(BENCH)), tmp_path / "saved.yaml")
    assert stat.S_IMODE(saved.stat().st_mode) == 0o644


def test_missing_folders_and_models_that_do_not_compose_are_refused(write: Write, tmp_path: Path) -> None:
    model = load_model(write(BENCH))
    with pytest.raises(ModelError, match="there is no folder"):
        save_model(model, tmp_path / "nowhere" / "bench.yaml")
    with pytest.raises(ModelError, match="named twice"):
        save_model(replace(model, effects=("spool_dynamics", "spool_dynamics")), tmp_path / "saved.yaml")


def test_two_effect_files_of_one_name_are_refused_with_the_line(write: Write, tmp_path: Path) -> None:
    (tmp_path / "end_stop.py").write_text(
        (Path(load_model("sample_bench").library.source_file("end_stop"))).read_text()
    )
    path = write(BENCH + "user_effects: [end_stop.py]\n")
    with pytest.raises(ModelError, match=rf"{path}:29: .*'end_stop' is already defined"):
        load_model(path)


def test_a_mechanical_plant_needs_no_oil(write: Write) -> None:
    path = write(
        "format: hydraulic-model-1\nplant: mechanical\nparameters: {moving_mass: 2 kg, drive_force: 5 N/V}\n"
        "effects: {viscous_friction: {coefficient: 1 N*s/m}}\n"
    )
    model = load_model(path)
    assert model.name == "bench"
    assert set(model.keys()) == {
        "moving_mass", "stroke", "drive_limit", "drive_force", "bristle_length", "bristle_time",
        "viscous_friction.coefficient", "end_stop.stiffness",
        "end_stop.damping",
    }  # fmt: skip
    path.write_text(path.read_text().replace("viscous_friction: {coefficient: 1 N*s/m}", "internal_leakage: {}"))
    with pytest.raises(ModelError, match=r"bench\.yaml: internal_leakage acts on the oil"):
        load_model(path)
