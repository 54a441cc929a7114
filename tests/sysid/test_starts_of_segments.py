"""Segments that begin at rest, where dry friction holds the piston with a force that nothing shows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.estimation.fit import FitPoint, FitSettings, fit_segments
from hydraulic_sysid.estimation.known_starts import KnownStarts
from hydraulic_sysid.estimation.run_ups import SHORTEST, RunUps, longest_worth, sufficient
from hydraulic_sysid.estimation.segments import STICK_SPEED, Segments, cut
from hydraulic_sysid.estimation.shooting import Shooting

DT, SECONDS = 1e-3, 16.0
NOISE = {"position": 5e-6, "pressure_a": 4e3, "pressure_b": 4e3}


@pytest.fixture(scope="module")
def model(compiled_physics: None) -> Model:
    return load_model("sample_bench").with_values({"coulomb_friction.level": 3000.0})


def rests(model: Model, quiet: float = 1.0) -> list[Segments]:
    """Short steps with rests between: the piston stops with its bristles bent, one way or the other.

    ``quiet``: of the noise, how much there is.
    """
    time = DT * np.arange(round(SECONDS / DT))
    height = np.random.default_rng(3).choice([-4.0, -2.5, 2.5, 4.0], size=int(SECONDS / 0.8) + 1)
    drive = np.where(time % 0.8 < 0.15, height[(time / 0.8).astype(int)], 0.0)
    run, draw = Plant(model).simulate(drive, DT), np.random.default_rng(1)
    channels = {c: run[c] + quiet * std * draw.standard_normal(time.size) for c, std in NOISE.items()}
    return cut([Record.sampled("rests", DT, {"drive": drive, **channels})], "hydraulic", 0.5)


@pytest.fixture(scope="module")
def segments(model: Model) -> list[Segments]:
    return rests(model)


def worst(point: FitPoint) -> float:
    """Largest mean square of a segment."""
    return max(
        float(np.max(np.sum(p.residual**2, axis=1) / s.counted))
        for p, s in zip(point.projections, point.shooting.segments, strict=True)
    )


def test_a_segment_that_is_held_by_dry_friction_does_not_ring(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    held = worst(FitPoint.begin(Plant.for_fits(model), rests(model, quiet=0.1), ()).at_rest())
    segments = rests(model, quiet=0.1)
    monkeypatch.setattr(Segments, "turning", lambda s, _: np.full(len(s), np.nan))
    monkeypatch.setattr(Segments, "_bent", lambda s, _: np.clip(s.smoothed[s.first, 1] / STICK_SPEED, -1.0, 1.0))
    ringing = worst(FitPoint.begin(Plant.for_fits(model), segments, ()).at_rest())
    assert ringing > 3.0
    assert held < 1.5


@pytest.mark.parametrize(("volts", "noise", "known"), [(0.02, 1e-8, True), (-0.02, 1e-8, True), (0.02, 1e-4, False)])
def test_a_creeping_piston_has_its_dry_friction_in_full(model: Model, volts: float, noise: float, known: bool) -> None:
    """Below the speed from which friction has its direction, but many bristle lengths on; noise may hide that."""
    plant, n = Plant.for_fits(model), round(4.0 / DT)
    run, draw = Plant(model).simulate(np.full(n, volts), DT), np.random.default_rng(1)
    position = run["position"] + noise * draw.standard_normal(n)
    channels = {"position": position, "pressure_a": run["pressure_a"], "pressure_b": run["pressure_b"]}
    (s,) = cut([Record.sampled("creep", DT, {"drive": np.full(n, volts), **channels})], "hydraulic", 0.5)
    stick = s.initial_states(plant)[:, plant.state_names.index("stick")]
    late = s.first > 1.0 / DT
    assert 0.0 < np.abs(run["velocity"][s.first[late]]).max() < STICK_SPEED
    assert np.isnan(s.turning(plant)[late]).all() == known
    assert (stick[late] == np.sign(volts)).all() == known


def test_long_bristles_bend_by_the_way_gone_since_the_piston_turned(model: Model) -> None:
    long = model.with_effect("presliding", {"length": 2e-3})
    plant = Plant(long)
    assert (plant.bristle_length, Plant(model).bristle_length) == (2e-3, model.value("bristle_length"))
    time = DT * np.arange(round(SECONDS / DT))
    drive = 0.4 * np.sin(2.0 * np.pi * 0.7 * time)
    run, draw = plant.simulate(drive, DT), np.random.default_rng(1)
    channels = {c: run[c] + std * draw.standard_normal(time.size) for c, std in NOISE.items()}
    (s,) = cut([Record.sampled("slow", DT, {"drive": drive, **channels})], "hydraulic", 0.3)
    column = plant.state_names.index("stick")
    true = np.array([plant.simulate(drive[:first], DT).final.states[column] for first in s.first[1:]])
    moving = np.abs(s.smoothed[s.first[1:], 1]) > STICK_SPEED
    turning = moving & (np.abs(true) < 0.8)
    assert turning.sum() > 5, "of these the direction would not do"
    assert np.abs(s.initial_states(plant)[1:, column] - true)[moving].max() < 0.1


def test_without_dry_friction_nothing_is_held(model: Model, segments: list[Segments]) -> None:
    plant, (s,) = Plant.for_fits(model.without_effect("coulomb_friction")), segments
    turning = s.turning(plant)
    assert 0 < np.isfinite(turning).sum() < len(s)
    states = s.initial_states(plant)
    runs = [plant.predict(s.record["drive"], DT, s.first, 50, states, turning=a) for a in (None, turning)]
    assert all(np.array_equal(runs[0][c], runs[1][c]) for c in NOISE)


@pytest.mark.parametrize("begin", [450.0, 1500.0, 2500.0])
def test_dry_friction_is_found_from_one_pressure_at_a_time(begin: float) -> None:
    """Soft oil settles far more slowly than a segment lasts: the other pressure follows from motion and valve."""
    soft = {"bulk_modulus": 2e8, "dead_volume_a": 4e-3, "dead_volume_b": 4e-3}
    bench, time = load_model("sample_bench").with_values(soft), DT * np.arange(8000)
    draw = np.random.default_rng(7)
    drive = draw.uniform(-2.0, 2.0, 16)[(time / 0.5).astype(int)]
    run = Plant(bench.with_values({"coulomb_friction.level": 3000.0})).simulate(drive, DT)
    noisy = {c: run[c] + std * draw.standard_normal(time.size) for c, std in NOISE.items()}
    records = [
        Record.sampled(c, DT, {"drive": drive, **{k: v for k, v in noisy.items() if k != c}}) for c in list(NOISE)[1:]
    ]
    key = "coulomb_friction.level"
    found = fit_segments(
        Plant.for_fits(bench.with_values({key: begin})), cut(records, "hydraulic", 0.25), [key], FitSettings()
    )
    assert found.values[key] == pytest.approx(3000.0, rel=0.02)


def test_longer_steps_leave_an_error_far_below_the_noise(model: Model, segments: list[Segments]) -> None:
    (s,), coarse = segments, Plant.for_fits(model)
    begin = FitPoint.begin(coarse, segments, ()).initial_states[0]
    runs = [p.predict(s.record["drive"], DT, s.first, s.samples - 1, begin) for p in (coarse, Plant(model, 1e-4, 0.2))]
    for channel, std in NOISE.items():
        error = runs[0][channel] - runs[1][channel]
        assert np.sqrt(np.mean(error**2)) < 0.05 * std, channel


def test_segments_that_stay_clear_of_the_stops_run_without_them(model: Model) -> None:
    """Of a light piston, whose stops ask for short steps: those that meet one, or come near, run as they always do."""
    light = model.with_values({
        "moving_mass": 1.0, "piston_area_a": 2e-4, "piston_area_b": 2e-4, "valve_flow": 1e-4, "stroke": 0.2,
        "dead_volume_a": 2e-5, "dead_volume_b": 2e-5, "coulomb_friction.level": 30.0,
    })  # fmt: skip
    plant, time = Plant.for_fits(light), DT * np.arange(round(4.0 / DT))
    drive = np.where(time < 2.0, 1.5 * np.sin(2.0 * np.pi * time), 4.0 * np.sin(2.0 * np.pi * 0.5 * time))
    run = Plant(light).simulate(drive, DT)
    cuts = cut([Record.sampled("both", DT, {"drive": drive, **{c: run[c] for c in NOISE}})], "hydraulic", 0.5)
    shooting, (s,) = Shooting(plant, cuts), cuts
    clear = np.abs(s.measured[..., s.channels.index("position")]).max(axis=1) < 0.09
    assert clear.any() and not clear.all()
    states = shooting.initial_states
    (found,) = shooting.simulated(plant, states)
    with_stops = plant.predict(s.drive, DT, s.first, s.samples - 1, states[0], None, s.turning(plant))
    for c, channel in enumerate(s.channels):
        assert np.array_equal(found[~clear][..., c], with_stops[channel][~clear])
        assert not np.array_equal(found[clear][..., c], with_stops[channel][clear]), "with other steps"
        near = 2e-3 * float(np.ptp(with_stops[channel]))
        assert found[clear][..., c] == pytest.approx(with_stops[channel][clear], abs=near)


def test_directions_that_are_kept_lead_to_the_same_minimum(model: Model, segments: list[Segments]) -> None:
    """Those of the initial states are taken anew at the end, so that fitting on gains nothing."""
    key = "viscous_friction.coefficient"
    plant = Plant.for_fits(model.with_values({key: 0.8 * model.value(key)}))
    found = fit_segments(plant, segments, [key], FitSettings())
    again = fit_segments(plant.with_parameters(found.values), segments, [key], FitSettings())
    assert again.values[key] == pytest.approx(found.values[key], rel=1e-3)
    assert again.cost == pytest.approx(found.cost, rel=1e-4)


def test_a_segment_that_begins_far_off_alone_finds_its_way(model: Model, segments: list[Segments]) -> None:
    """Its share of the sum is too small for the directions of all to be taken anew."""
    at = FitPoint.begin(Plant.for_fits(model), segments, ()).at_rest()
    states = at.initial_states[0].copy()
    states[7, :4] += [2e-3, -0.05, 1e6, -1e6]
    raw = at.shooting.residuals(at.plant, [states])
    away = replace(at, initial_states=[states], projections=[at.projections[0].with_raw(raw[0])])
    assert worst(away) > 20.0
    assert worst(away.unstuck()) < 1.05 * worst(at)
    assert away.unstuck().cost < 1.001 * at.cost
    others = np.arange(len(states)) != 7
    assert np.array_equal(away.unstuck().initial_states[0][others], states[others])


def test_a_fit_begins_where_the_last_one_ended(model: Model, segments: list[Segments]) -> None:
    """Where that leaves less than what the record shows of the beginning; so, too, of some of the segments."""
    plant, starts, (s,) = Plant.for_fits(model), KnownStarts(), segments
    fitted = FitPoint.begin(plant, segments, ()).at_rest()
    starts.keep(segments, fitted.initial_states)
    smoothed = s.smoothed.copy()
    smoothed[s.first[7]] += [2e-3, 0.0, 1e6, -1e6]
    misread = [replace(s, smoothed=smoothed)]
    assert worst(FitPoint.begin(plant, misread, ())) > 2.0 * worst(fitted)
    assert worst(FitPoint.begin(plant, misread, (), starts=starts)) < 1.05 * worst(fitted)
    every_other = [misread[0].subset(np.arange(len(s)) % 2 == 1)]
    assert worst(FitPoint.begin(plant, every_other, (), starts=starts)) < 1.05 * worst(fitted)
    begin, wrong = FitPoint.begin(plant, segments, ()), KnownStarts()
    assert FitPoint.begin(plant, segments, (), starts=starts).cost <= fitted.cost * (1.0 + 1e-9)
    wrong.keep(segments, [fitted.initial_states[0] + 1.0])
    assert FitPoint.begin(plant, segments, (), starts=wrong).cost == begin.cost


def test_initial_states_stay_where_they_are_where_moved_the_plant_does_not_run(
    model: Model, segments: list[Segments], monkeypatch: pytest.MonkeyPatch
) -> None:
    plant = Plant.for_fits(model)
    shooting = Shooting(plant, segments)
    begin = shooting.initial_states
    before = shooting.projections(plant, begin)
    moved = shooting.improved(plant, begin, before)[0]
    assert not np.array_equal(moved[0], begin[0])
    run = Shooting.residuals

    def residuals(self: Shooting, plant: Plant, states: list[Array]) -> list[Array]:
        if not np.array_equal(states[0], begin[0]):
            raise SimulationError("a state is no longer finite")
        return run(self, plant, states)

    monkeypatch.setattr(Shooting, "residuals", residuals)
    states, left = shooting.improved(plant, begin, before)
    assert states[0] is begin[0] and left[0] is before[0]


def test_fits_stay_away_from_parameters_that_make_the_physics_far_stiffer(
    model: Model, segments: list[Segments]
) -> None:
    shooting = Shooting(Plant.for_fits(model), segments)
    plant = Plant.for_fits(model.with_effect("supply_droop"))
    soft, stiff = (
        plant.with_parameters({"supply_droop.resistance": r, "supply_droop.time": t})
        for r, t in ((1e9, 0.1), (1e12, 1e-3))
    )
    assert len(shooting.try_out(soft, shooting.initial_states)) == 1
    with pytest.raises(SimulationError, match="asks for steps of"):
        shooting.try_out(stiff, shooting.initial_states)


def run_ups_of(monkeypatch: pytest.MonkeyPatch) -> list[int | None]:
    """Takes the run-up of every propagation along a record from here on."""
    run_ups, track = list[int | None](), Plant.track

    def tracked(self: Plant, *arguments: Any) -> tuple[Array, Array]:
        run_ups.append(arguments[4])
        return track(self, *arguments)

    monkeypatch.setattr(Plant, "track", tracked)
    return run_ups


@pytest.mark.parametrize(
    ("effect", "memory", "values"),
    [
        ("spool_dynamics", "damping", {}),
        ("supply_droop", "time", {}),
        ("structural_flexibility", "mass", {}),
        ("valve_hysteresis", "half_width", {"half_width": 0.2}),
    ],
)
def test_what_no_sensor_sees_is_propagated_from_where_it_makes_no_difference(
    model: Model, effect: str, memory: str, values: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two segments far apart, each long after a burst that leaves the valve's play on the other side."""
    plant = Plant.for_fits(model.with_effect(effect, values))
    time = DT * np.arange(40_000)
    burst = np.where(time < 20.0, 8.0, -8.0) * np.sin(2.0 * np.pi * 2.0 * time)
    drive = np.where(time % 20.0 < 1.0, burst, np.sin(2.0 * np.pi * time))
    run = plant.simulate(drive, DT)
    apart = cut([Record.sampled("apart", DT, {"drive": drive, **{c: run[c] for c in NOISE}})], "hydraulic", 0.5)[0]
    apart = apart.subset(np.isin(np.arange(len(apart)), (24, 72)))
    run_ups = run_ups_of(monkeypatch)
    shooting = Shooting(plant, [apart])
    states = shooting.initial_states
    short = shooting.simulated(plant, states)[0]
    assert run_ups[-1] is not None
    tried = len(run_ups)
    for known in (apart, apart.subset(np.array([False, True]))):
        other = Shooting(plant, [known])
        other.simulated(plant, other.initial_states)
    # Another fit knows it, and one to some of the segments, unless a longer one is worth it for them, and might do.
    assert len(run_ups) == tried + 2
    slower = plant.with_parameters({f"{effect}.{memory}": 8.0 * plant.value(f"{effect}.{memory}")})
    Shooting(slower, [apart]).simulated(slower, states)
    assert len(run_ups) > tried + 3, "of another memory it is another"
    whole = Shooting(plant, [replace(apart, run_ups=Never())]).simulated(plant, states)[0]
    assert run_ups[-1] is None
    assert np.all(np.abs(short - whole) <= 1e-3 * np.ptp(whole, axis=(0, 1)))


MOVED = '''"""A valve that keeps where the piston was furthest, as no run-up shows."""
from hydraulic_sim.effect import Effect, Parameter

def furthest(command, position, size, memory):
    memory[0] = max(memory[0], position)
    return command + size * memory[0]

EFFECT = Effect(
    slot="command", summary="furthest", kernel=furthest, memory=1, equation="-", source="test", excited_by="-",
    confused_with=(), distinguished_by="-",
    parameters=(Parameter("size", "1/m", 0.1, (0.0, 1.0), "-", "test", null=0.0),),
)
'''


def test_what_keeps_the_motion_is_propagated_along_the_whole_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "furthest.py"
    file.write_text(MOVED)
    lean = replace(load_model("sample_bench"), lean=True)  # compiled in a fraction of the time
    plant = Plant.for_fits(lean.with_effect_file(file).with_effect("furthest"))
    drive = 0.4 * np.sin(2.0 * np.pi * 0.1 * DT * np.arange(12_000))
    run = plant.simulate(drive, DT)
    segments = cut([Record.sampled("one", DT, {"drive": drive, **{c: run[c] for c in NOISE}})], "hydraulic", 0.5)[0]
    apart = segments.subset(np.arange(len(segments)) % 10 == 0)
    assert plant.lasting_memories and plant.drive_path is None and longest_worth(apart.first) > 0
    asked = run_ups_of(monkeypatch)
    shooting = Shooting(plant, [apart])
    shooting.simulated(plant, shooting.initial_states)
    assert asked and set(asked) == {None}


class Never(RunUps):
    """Of a record on which nothing is ever forgotten."""

    def find(self, *_: Any) -> None:
        return None


def test_a_run_up_is_of_plants_with_the_same_laws_and_values_like_these() -> None:
    sought, short, long = [], 2 * SHORTEST, 16 * SHORTEST

    def seek(least: int, most: int) -> int | None:
        sought.append((least, most))
        return 4 * SHORTEST if most == long and len(sought) < 3 else None

    known = RunUps()
    assert known.find(("a", 1.0, 0.0), short, seek) is None, "it is longer"
    assert [known.find(("a", v, 0.0), long, seek) for v in (1.0, 3.0, 0.3)] == [4 * SHORTEST] * 3
    assert known.find(("a", 2.0, 0.0), short, seek) is None
    assert sought == [(SHORTEST, short), (2 * short, long)], "once each, and nothing that has failed"
    for path in (("a", 5.0, 0.0), ("a", -1.0, 0.0), ("a", 1.0, 1e-9)):
        assert known.find(path, long, seek) is None
    assert sought[2:] == [(4 * SHORTEST, long)] * 3, "what is shorter did for none of these laws"
    known.find(("b", 1.0, 0.0), long, seek)
    assert sought[-1] == (SHORTEST, long)
    number = len(sought)
    known.find(("b", 1.0), long, seek)
    assert len(sought) == number + 1, "a law of that name with other values was written anew"


@pytest.mark.parametrize(
    ("first", "worth"),
    [((500, 1000, 1500), 128), ((600, 1200, 1800), 256), ((4000, 12_000), 2048), ((0,), 0), ((40,), 0)],
)
def test_a_run_up_is_worth_it_where_it_leaves_out_half_of_the_record(first: tuple[int, ...], worth: int) -> None:
    assert longest_worth(np.array(first)) == worth


@pytest.mark.parametrize(("length", "found"), [(2000, None), (6000, 512)])
def test_a_short_record_is_propagated_as_a_whole(length: int, found: int | None) -> None:
    """Of a state that forgets in 60 samples, at so few instants that they show no range of it, nothing is said."""

    def propagated(starts: Index, run_up: int | None) -> Array:
        since = starts if run_up is None else np.minimum(starts, run_up)
        return (np.sin(starts) + np.exp(-since / 60.0))[:, None]

    assert sufficient(length, propagated, propagated, SHORTEST, 2048) == found
