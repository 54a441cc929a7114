"""The family of benches: geometries that move and keep their pressures, sensors, loops, data sheets, and the draw."""

from __future__ import annotations

import json

import numpy as np
import pytest

from hidden_effects import benches, catalogue, family, matrix, motion, scoring, sensors, settings
from hidden_effects.geometry import GEOMETRIES, balanced
from hydraulic_sim.model_file import load_model
from hydraulic_sim.registry import library
from hydraulic_sysid.data.records import read_all
from hydraulic_sysid.estimation.fit import fit

EVERY = tuple(GEOMETRIES.values())


def plain(geometry: str, kind: str = "white", loop: str = "open", sheet: str = "right", seed: int = 1) -> benches.Bench:
    return benches.Bench("none", seed=seed, setting=settings.Setting(geometry, kind, loop, sheet))


def test_the_family_is_as_wide_as_it_says():
    assert len(GEOMETRIES) >= 6 and len(sensors.KINDS) >= 5 and len(motion.LOOPS) == len(settings.SHEETS) == 2
    strokes, masses = ([g.plain[k] for g in EVERY] for k in ("stroke", "mass"))
    assert min(strokes) == 0.1 and max(strokes) == 3.0 and min(masses) == 5.0 and max(masses) == 20e3
    assert any(not g.pressures for g in EVERY) and any(g.plain["load"] for g in EVERY)
    assert sum(g.plain["area"] != g.plain["area_b"] for g in EVERY) >= 2


@pytest.mark.parametrize("loop", motion.LOOPS)
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_experiments_use_the_stroke_and_spare_the_stops(geometry, loop):
    g = GEOMETRIES[geometry]
    bench = plain(geometry, loop=loop)
    runs = benches.runs(bench)
    assert tuple(runs) == motion.NAMES
    travel = max(np.ptp(truth["position"]) for _, truth in runs.values())
    fastest = max(abs(truth["velocity"]).max() for _, truth in runs.values())
    assert travel > 0.25 * g.plain["stroke"] and fastest > 0.4 * g.top_speed
    for table, truth in runs.values():
        assert len(table["time_s"]) == motion.SAMPLES and tuple(table) == bench.columns
        assert abs(truth["position"]).max() < 0.48 * g.plain["stroke"]
        for side in ("pressure_a", "pressure_b"):
            assert truth[side].min() > 0.02 * g.plain["supply"] and truth[side].max() < 1.02 * g.plain["supply"]


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_the_librarys_simulator_explains_the_plain_bench(geometry, tmp_path):
    """From the true parameters: laws differ by less than the noise, so that "complete" is a fair answer."""
    bench = plain(geometry, loop="closed")
    made = benches.make(bench, names=("random",))
    records = read_all(benches.write_records(made, tmp_path, bench.setting.decimals))
    (tmp_path / "model.yaml").write_text(benches.model_text(bench))
    built = bench.values()
    true = {
        "moving_mass": "mass", "bulk_modulus": "bulk_modulus", "valve_flow": "valve_flow", "bristle_length": "bristle",
        "bristle_time": "bristle_time", "viscous_friction.coefficient": "viscous", "coulomb_friction.level": "coulomb",
        "internal_leakage.coefficient": "leakage", "constant_load.load": "load",
        "spool_dynamics.frequency": "spool_frequency", "spool_dynamics.damping": "spool_damping",
    }  # fmt: skip
    model = load_model(tmp_path / "model.yaml")
    for key, ours in true.items():
        if key in model.keys():  # noqa: SIM118, a method of the model
            model = model.with_entry(key, value=built[ours])
    free = ("valve_flow", "internal_leakage.coefficient", "coulomb_friction.level")  # orifice and leakage laws differ
    assert fit(model, records, free).rms < 1.06


def test_shut_in_pressures_balance_what_hangs():
    g = GEOMETRIES["hoist"]
    a, b = balanced(g.plain)
    assert a * g.plain["area"] + g.plain["load"] == pytest.approx(b * g.plain["area_b"])
    assert g.plain["load"] == pytest.approx(9.81 * g.plain["mass"])
    assert 0.1e6 < a < g.plain["supply"]


@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_sizes_stay_within_what_the_library_allows(geometry):
    every = library(())
    for severity in benches.SEVERITIES:
        for name in family.possible(GEOMETRIES[geometry], "single", severity):
            bounds = {p.name: p.bounds for p in every[name].parameters}
            for seed in range(3):
                bench = benches.Bench("single", (name,), severity, seed, settings.Setting(geometry))
                for key, value in bench.truth()[name].items():
                    low, high = bounds[key]
                    assert low <= value <= high, (name, key, value)


def test_a_size_means_the_same_relative_to_the_plant():
    first, small = GEOMETRIES["bench"], GEOMETRIES["small"]
    assert all(first.scale(key) == 1.0 for key in ("load", "leakage", "sensor_lag", "sensor_step"))
    assert small.scale("sensor_offset") == pytest.approx(0.1 / 1.524)
    force = (small.plain["supply"] - small.plain["tank"]) * small.plain["area"]
    assert small.scale("load") == pytest.approx(force / (13.7e6 * first.plain["area"]))
    assert small.scale("overlap") == 1.0


def test_a_sheet_that_is_off_is_wrong_everywhere_and_says_so_nowhere(tmp_path):
    bench = plain("press", sheet="off")
    path = tmp_path / "model.yaml"
    path.write_text(benches.model_text(bench))
    model, built = load_model(path), bench.plain()
    keys = {"piston_area_a": "area", "piston_area_b": "area_b", "dead_volume_a": "dead_volume",
            "dead_volume_b": "dead_volume_b", "supply_pressure": "supply"}  # fmt: skip
    for theirs, ours in keys.items():
        assert 1e-5 < abs(built[ours] / model.value(theirs) - 1.0) <= 0.03
        assert model.entries[theirs].bounds is None
    right = plain("press").plain()
    assert all(right[ours] == pytest.approx(model.value(theirs), rel=1e-5) for theirs, ours in keys.items())
    low, high = model.entries["moving_mass"].bounds
    assert (low, high) == (pytest.approx(200.0), pytest.approx(300.0))
    assert {"spool_dynamics", "viscous_friction"} <= set(model.effects)


@pytest.mark.parametrize("name", catalogue.DATUM)
def test_a_wrong_number_is_beyond_what_the_file_allows(name, tmp_path):
    bench = benches.Bench("datum", (name,), "mild", 2, settings.Setting("press"))
    path = tmp_path / "model.yaml"
    path.write_text(benches.model_text(bench))
    model = load_model(path)
    ((key, true),) = bench.truth()[name].items()
    given = model.value(key)
    assert bench.answer()["said"][0][0] == key
    assert abs(true / given - 1.0) > 0.02
    low, high = model.entries[key].bounds or (given, given)
    assert not low <= true <= high


def recorded(sensor: sensors.Sensors, samples: int = 40_000) -> tuple[np.ndarray, np.ndarray]:
    sizes = np.array([1e-5, 1e4, 1e4])
    rng = np.random.default_rng(5)
    drawn = sensors.noise(sensor, rng, sizes, samples)
    return sensors.seen(sensor, rng, drawn + np.array([[0.0], [5e6], [6e6]]), drawn, sizes, 16e6), sizes


def test_filtered_noise_keeps_its_size_and_loses_its_heights():
    sensor = sensors.Sensors(corners=(100.0, 100.0))
    channels, sizes = recorded(sensor)
    for row, size in zip(channels, sizes, strict=True):
        assert row.std() == pytest.approx(size, rel=0.02)
        power = np.abs(np.fft.rfft(row - row.mean())) ** 2
        frequency = np.fft.rfftfreq(len(row), 1e-3)
        assert power[frequency > 300.0].mean() < 0.02 * power[(frequency > 1.0) & (frequency < 50.0)].mean()


def test_a_transducer_delays_by_its_low_pass_and_begins_at_rest():
    sensor = sensors.Sensors(transducer=100.0)
    ramp = np.vstack([np.zeros(400), *[np.maximum(np.arange(400.0) - 100.0, 0.0)] * 2])
    still = np.zeros_like(ramp)
    found = sensors.seen(sensor, np.random.default_rng(1), ramp, still, np.ones(3), 16e6)
    behind = 2.0 * sensors.DAMPING / (2.0 * np.pi * 100.0) * 1e3  # samples
    assert found[1, 50] == 0.0
    assert ramp[1, -1] - found[1, -1] == pytest.approx(behind, rel=1e-3)


def test_hum_is_a_line_of_its_size():
    channels, sizes = recorded(sensors.Sensors(hum=(3.0, 0.5)))
    for row, size, rms in zip(channels[1:], sizes[1:], (3.0, 0.5), strict=True):
        assert row.std() == pytest.approx(size * np.sqrt(1.0 + 1.0225 * rms**2), rel=0.03)
    line = np.abs(np.fft.rfft(channels[1] - channels[1].mean()))
    assert np.fft.rfftfreq(channels.shape[1], 1e-3)[line.argmax()] == pytest.approx(50.0, abs=0.05)


def test_converters_have_steps_of_their_range():
    channels, _ = recorded(sensors.Sensors(bits=12))
    codes = channels[1] / (25e6 / 4096)
    assert abs(codes - codes.round()).max() < 1e-6
    assert np.ptp(codes.round()) > 3


def test_spikes_are_rare_and_clear():
    channels, sizes = recorded(sensors.Sensors(spikes=1e-3))
    for row, size in zip(channels, sizes, strict=True):
        far = abs(row - np.median(row)) > 30.0 * size
        assert 20 < far.sum() < 70


@pytest.mark.parametrize("kind", sensors.KINDS)
def test_a_bench_of_any_sensors_is_reproducible(kind):
    bench = plain("press", kind, "closed")
    one, two = (benches.make(bench, names=("random",))["random"] for _ in range(2))
    assert all(np.array_equal(one[c], two[c]) for c in bench.columns)


def test_channels_that_are_late_are_shifted_and_nothing_else_differs():
    def made(name, without=()):
        bench = benches.Bench("recording", (name,), "strong", 3, settings.Setting("press"))
        return bench.values(), benches.make(bench, without=without, names=("steps",))["steps"]

    for name, columns in (("pressures_late", ("pressure_a_Pa", "pressure_b_Pa")), ("drive_late", ("command_V",))):
        values, table = made(name)
        right = made(name, (name,))[1]
        late = round(values[name])
        assert late in (2, 3)
        for c in table:
            if c in columns:
                assert np.array_equal(table[c][late:], right[c][:-late])
            else:
                assert np.array_equal(table[c], right[c])


def test_the_draw_is_stable_wide_and_readable():
    drawn = family.draw(300, [3])
    assert drawn[:20] == family.draw(20, [3])
    assert len({b.name for b in drawn}) == 300
    assert not {b.name for b in drawn} & {b.name for b in family.draw(300, [4])}
    assert {b.setting.geometry for b in drawn} == set(GEOMETRIES)
    assert {b.setting.sensors for b in drawn} == set(sensors.KINDS)
    assert {b.kind for b in drawn} == {"none", "single", "datum", "recording"}
    assert {b.kind for b in family.draw(30, [3], "datum")} == {"datum"}
    for b in drawn:
        never = b.setting.actuator.never + (b.setting.actuator.faint if b.severity == "mild" else ())
        assert not set(b.effects) & {*never, *family.AMBIGUOUS}
        assert b.name.startswith(b.setting.name)
        json.dumps(b.answer())


@pytest.mark.parametrize(("what", "number"), [("pair", 2), ("triple", 3), ("unknown", 1)])
def test_what_is_drawn_only_when_asked_for(what, number):
    drawn = family.draw(60, [3], what)
    assert {b.kind for b in drawn} == {what} and {len(b.effects) for b in drawn} == {number}
    assert {b.setting.geometry for b in drawn} == set(GEOMETRIES)
    known = catalogue.UNKNOWN if what == "unknown" else catalogue.LIBRARY
    for b in drawn:
        assert set(b.effects) <= set(known)
        assert len({h.subsystems[0] for h in b.hidden}) == number


def test_an_effect_that_the_records_hardly_show_is_not_asked_for(tmp_path):
    setting = settings.Setting("hoist", "hum", "open", "right")
    bench = benches.Bench("pair", ("sensor_delay", "stribeck_friction"), "mild", 8700100002, setting)
    place = benches.write(bench, tmp_path)
    records = read_all([place / "random.csv.gz"])
    assert matrix.visible(bench, load_model(place / "model.yaml"), records) == ["sensor_delay"]


def said(kind: str, **more):
    return {"verdict": {"kind": kind, "text": "", "subsystem": None}, "effects": [], **more}


def test_verdicts_on_a_member_of_the_family():
    nothing, spiky = plain("press").answer(), plain("press", "spiky").answer()
    assert scoring.judge(nothing, said("data sheet"))["silent"]
    assert not scoring.judge(nothing, said("recording"))["silent"]
    assert scoring.judge(spiky, said("recording"))["silent"]
    assert scoring.judge(nothing, said("missing"))["named_none"]
    area = benches.Bench("datum", ("piston_area_b",), "mild", 1, settings.Setting("press")).answer()
    other = [{"key": "piston_area_a"}]
    assert scoring.judge(area, said("data sheet", data_sheet=other))["fault_named"]
    assert not scoring.judge(area, said("missing", data_sheet=other))["fault_named"]
    assert not scoring.judge(area, said("data sheet", data_sheet=[{"key": "supply_pressure"}]))["fault_named"]
    late = benches.Bench("recording", ("pressures_late",), "mild", 1, settings.Setting("press")).answer()
    assert scoring.judge(late, said("recording", recording={"faults": [{"name": "pressures"}]}))["fault_named"]
    loose = benches.Bench("recording", ("spikes",), "mild", 1, settings.Setting("press")).answer()
    assert scoring.judge(loose, said("recording", recording={"faults": [], "spikes": [{}]}))["fault_named"]
    assert not scoring.judge(loose, said("recording", recording={"faults": [], "spikes": []}))["fault_named"]


def test_without_pressures_an_honest_tie_is_right():
    leak = benches.Bench("single", ("internal_leakage",), "mild", 1, settings.Setting("medium")).answer()
    verdict = said("indistinguishable")
    verdict["verdict"]["effects"] = ["viscous_friction", "internal_leakage"]
    marks = scoring.judge(leak, verdict)
    assert marks["right_first"] and marks["first_three"]
    seen = benches.Bench("single", ("internal_leakage",), "mild", 1, settings.Setting("press")).answer()
    assert not scoring.judge(seen, verdict)["right_first"]
