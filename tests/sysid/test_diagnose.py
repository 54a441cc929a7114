"""The parts of the diagnosis that can be tested apart; what it finds is tested in tests/hidden_effects."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search import DiagnosisError, add, diagnose, verdict
from hydraulic_sysid.diagnosis.search.anchor import SCATTER, bounded
from hydraulic_sysid.diagnosis.search.candidates import Hints, between, candidates, inverse, probes
from hydraulic_sysid.diagnosis.search.hints import spectral_lines
from hydraulic_sysid.diagnosis.search.levels import Level, material, repaired
from hydraulic_sysid.diagnosis.search.pieces import split
from hydraulic_sysid.diagnosis.search.screen import Prospect
from hydraulic_sysid.diagnosis.search.search import Found, Stage, Trial, _mends_a_law, _unrivalled, _varied
from hydraulic_sysid.diagnosis.search.shapes import FILES
from hydraulic_sysid.estimation.estimate import scale
from hydraulic_sysid.estimation.noise import code_step

DT = 1e-3


def standing(seconds: float, name: str = "r") -> Record:
    """Nothing but noise."""
    n = round(seconds / DT)
    draw = np.random.default_rng(3)
    return Record.sampled(
        name,
        DT,
        {
            "drive": np.zeros(n),
            "position": 2e-5 * draw.standard_normal(n),
            "pressure_a": 7.15e6 + 1.5e4 * draw.standard_normal(n),
            "pressure_b": 7.15e6 + 1.5e4 * draw.standard_normal(n),
        },
    )


@pytest.fixture(scope="module")
def model():
    return load_model("sample_bench")


def test_every_third_block_is_held_out_shifting_between_records(model) -> None:
    parts = split([standing(20.0, "a"), standing(20.0, "b")], [], Plant(model), 0.5)
    shares = [float(f.mean()) for f in parts.fitted]
    assert all(0.6 <= s <= 0.72 for s in shares)
    assert not np.array_equal(parts.fitted[0], parts.fitted[1])
    assert [len(p.starts) for p in parts.to_fit] == [int(f.sum()) for f in parts.fitted]


def test_named_records_are_held_out_whole(model) -> None:
    parts = split([standing(5.0, "a")], [standing(5.0, "b")], Plant(model), 0.5)
    assert parts.fitted[0].all() and not parts.fitted[1].any()
    assert [p.record.name for p in parts.to_fit] == ["a"]


def test_candidates_are_the_library_without_what_is_on_or_cannot_act(model) -> None:
    names = {e.name for e in candidates(model)}
    assert names == {e.name for e in model.library.values() if not e.always_on} - set(model.effects)
    assert not {"supply_droop"} & {e.name for e in candidates(model.with_effect("supply_droop"))}


def test_every_candidate_has_a_probe_off_its_null_value_within_bounds(model) -> None:
    for effect in candidates(model):
        groups = list(probes(effect, Hints(lines=(33.0,), resolution=1e-4)))
        assert groups, effect.name
        for group in groups:
            for probe in group:
                assert probe.values[probe.moved] != probe.null, effect.name
                for key, value in probe.values.items():
                    low, high = model.with_effect(effect.name).entry(key).bounds
                    assert low <= value <= high, key


def test_lines_are_tried_where_a_shape_is_a_frequency(model) -> None:
    ripple = model.library["pump_ripple"]
    tried = {p.values["pump_ripple.frequency"] for g in probes(ripple, Hints(lines=(33.0,))) for p in g}
    assert 33.0 in tried
    assert 33.0 not in {p.values["pump_ripple.frequency"] for g in probes(ripple, Hints()) for p in g}


@pytest.mark.parametrize("line", [7.0, 32.414, 180.3])
@pytest.mark.parametrize("reversals", [0.1, 0.46, 1.3])
def test_a_line_that_the_valve_modulates_is_found_between_side_bands(line: float, reversals: float) -> None:
    time = DT * np.arange(20001)
    drive = np.sign(np.sin(2.0 * np.pi * reversals * time))
    seen = drive * np.sin(2.0 * np.pi * line * time + 0.7) + np.random.default_rng(5).standard_normal(time.size)
    starts = np.arange(0, 20000, 500)
    record = Record.sampled("r", DT, {"drive": drive, "position": np.zeros(time.size)})
    pieces = SimpleNamespace(record=record, starts=starts, samples=501, channels=("position",), free=np.arange(2))
    residual = np.concatenate([seen[starts[:, None] + np.arange(501)], np.zeros((len(starts), 2))], axis=1)
    anchor = SimpleNamespace(split=SimpleNamespace(pieces=[pieces]), residual=[residual])
    assert spectral_lines(anchor)[0] == pytest.approx(line, abs=0.01)  # type: ignore[arg-type]


def test_an_angle_is_tried_with_every_frequency(model) -> None:
    tried = [group[0].values for group in probes(model.library["pump_ripple"], Hints(lines=(31.0,)))]
    angles = {v["pump_ripple.phase"] for v in tried if v["pump_ripple.frequency"] == 31.0}
    assert len(angles) == 4 and max(angles) == pytest.approx(1.5 * np.pi)


def test_a_parameter_whose_value_and_default_are_zero_has_a_scale(model) -> None:
    with_ripple = model.with_effect("pump_ripple")
    assert scale(with_ripple, "pump_ripple.phase") == pytest.approx(0.14)
    assert scale(with_ripple, "pump_ripple.amplitude") == with_ripple.value("pump_ripple.amplitude")


def stage(model, total: float, trials: dict[str, float]) -> Stage:
    """A stage with that sum of squares, and those of its trials."""
    found = [Trial(name, 0.0, None, at(left)) for name, left in trials.items()]  # type: ignore[arg-type]
    return Stage(model, None, at(total), [], found)  # type: ignore[arg-type]


def at(total: float) -> Level:
    return Level(2.0 * total / 3.0, total / 3.0, 2000, 1000)


@pytest.mark.parametrize(
    ("name", "left", "mends"),
    [
        ("valve_underlap", 4000.0, True),  # of the valve's own, repairs a thousandth of all
        ("valve_underlap", 3000.0, False),  # … and three thousandths
        ("constant_load", 4500.0, False),  # elsewhere a thousandth is enough
        ("constant_load", 5300.0, True),
        ("constant_load", 3050.0, False),  # and most of what is left always is
    ],
)
def test_what_a_law_leaves_is_no_effect(model, name: str, left: float, mends: bool) -> None:
    base, before = stage(model, 1.0e6, {}), stage(model, 5500.0, {})
    assert _mends_a_law(base, before, ["valve_deadband"], name, at(left)) is mends


@pytest.mark.parametrize(
    ("before", "after", "kind"),
    [
        (1.39, 1.12, verdict.MISSING),  # near the noise a law may leave more …
        (1.39, 1.19, verdict.OUTSIDE),  # … but not all it likes
        (10.0, 3.3, verdict.OUTSIDE),
        (10.0, 2.5, verdict.MISSING),
    ],
)
def test_what_an_effect_leaves_decides_whether_it_is_the_one(model, before: float, after: float, kind: str) -> None:
    with_it = model.with_effect("constant_load")
    found = Found(stage(model, 3000 * before, {}), stage(with_it, 3000 * after, {}), ["constant_load"], [], {})
    assert verdict.kind_of(found, {}) == kind


@pytest.mark.parametrize(
    ("own", "other", "final", "alone"),
    [
        (1e4, 8e5, 9e3, True),  # the other repairs a fifth
        (1e4, 3e5, 9e3, False),  # … or most of it, while not all is explained
        (4e5, 8e5, 9e3, False),  # it is not the whole answer itself
        (5e3, 5e4, 3.1e3, True),  # all is explained, and the other leaves twenty times as much
        (5e3, 1e4, 3.1e3, False),
    ],
)
def test_a_candidate_that_no_other_comes_near_has_no_rival(model, own, other, final, alone) -> None:
    base = stage(model, 1e6, {"valve_deadband": own, "backlash": other})
    assert _unrivalled(base, stage(model, final, {}), "valve_deadband") is alone


def test_later_refits_are_not_all_of_one_subsystem(model) -> None:
    names = ("spool_dynamics", "command_delay", "spool_rate_limit", "entrained_air")
    found = _varied([Prospect(model.library[name], 1.0, {}) for name in names], 2)
    assert [p.effect.name for p in found] == ["spool_dynamics", "command_delay", "entrained_air"]


def test_an_observed_parameter_is_tried_at_what_was_seen_alone(model) -> None:
    quantised = model.library["sensor_quantisation"]
    assert [g[0].values for g in probes(quantised, Hints(resolution=3e-4))] == [{"sensor_quantisation.step": 3e-4}]
    assert list(probes(quantised, Hints())) == []


def test_half_the_influence_of_a_frequency_is_twice_the_frequency() -> None:
    assert inverse(1000.0, 80.0) and not inverse(0.0, 0.02)
    assert between(1000.0, 80.0, 0.5, 80.0) == 160.0
    assert between(0.0, 0.04, 0.5, 0.02) == 0.02
    assert between(1.0, 1.04, 0.5, 1.03) == pytest.approx(1.02)


def test_a_gain_must_show_on_fitted_and_on_held_out_pieces() -> None:
    before = Level(1.2e5, 6e4, 100_000, 50_000)
    assert material(before, Level(1.1e5, 5.5e4, 100_000, 50_000))
    assert not material(before, Level(1.1e5, 6.1e4, 100_000, 50_000))  # fitted away, not confirmed
    assert not material(before, Level(1.2e5, 5.5e4, 100_000, 50_000))
    assert not material(before, Level(1.2e5 - 30.0, 6e4 - 15.0, 100_000, 50_000))  # chance has more
    assert repaired(before, Level(1.0e5, 5.0e4, 100_000, 50_000)) == pytest.approx(1.0)
    assert before.excess == pytest.approx(3e4)


def test_free_parameters_without_bounds_get_the_data_sheets_scatter(model) -> None:
    bench = bounded(load_model("moog_mcr_m_1002_bench"))
    assert bench.entry("moving_mass").bounds == (500.0 / SCATTER, 500.0 * SCATTER)
    assert bounded(model).entry("moving_mass").bounds == (400.0, 600.0)  # the file's own


def test_the_step_of_codes_survives_what_a_text_file_rounds_away() -> None:
    step = 0.000255091218
    x = np.round(np.linspace(-0.2, 0.2, 5000) / step) * step
    assert code_step(np.round(x, 6)) == pytest.approx(step, rel=1e-6)
    assert code_step(np.random.default_rng(0).standard_normal(500)) == 0.0
    assert code_step(np.zeros(50)) == 0.0


def test_shapes_are_effects_of_their_own_and_none_of_the_library(model) -> None:
    assert FILES
    for file in FILES:
        assert file.stem not in model.library


def test_effects_of_the_amplifier_are_named_before_the_hydraulics() -> None:
    plain = standing(2.0)
    told = Record.sampled(
        "told", DT, dict(plain.channels), description={"plant": {"imitated_effects": ["valve_deadband"]}}
    )
    assert verdict.imitated([plain]) == [] and verdict.imitated([plain, told]) == ["valve_deadband"]
    assert "read those settings first" in verdict.warning(["valve_deadband"], ["valve_deadband"])
    assert verdict.warning(["valve_deadband"], []) == ""


def test_without_pressures_a_family_of_effects_is_named_whole(model) -> None:
    assert verdict.alike(model, ["valve_deadband"], ["position", "pressure_a", "pressure_b"]) == {}
    found = verdict.alike(model, ["valve_deadband", "entrained_air"], ["position"])
    assert set(found) == {"valve_deadband"}
    assert {"stribeck_friction", "backlash", "valve_hysteresis"} <= set(found["valve_deadband"])
    assert "coulomb_friction" not in found["valve_deadband"]  # on already
    assert set(verdict.alike(model, ["sensor_lag"], ["position"])["sensor_lag"]) == {
        "command_delay",
        "spool_dynamics",
        "sensor_delay",
    }


def test_unusable_input_is_named(model) -> None:
    with pytest.raises(DiagnosisError, match="no record"):
        diagnose(model, [])
    with pytest.raises(DiagnosisError, match="coulomb_friction is on already"):
        add(model, "coulomb_friction", [standing(2.0)])
    bare = Record.sampled("bare", DT, {"drive": np.zeros(2000)})
    with pytest.raises(DiagnosisError, match="bare: no channel 'position'"):
        diagnose(model, [bare])
