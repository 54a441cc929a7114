"""What else a fit may move beside parameters: initial states, nuisance, priors, and how a channel was recorded."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from hydraulic_sim.model_file import load_model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.diagnosis.search.holdout import Split
from hydraulic_sysid.diagnosis.search.misfit import Misfit
from hydraulic_sysid.diagnosis.search.recording_faults import HYPOTHESES, Hypothesis, RecordingFault
from hydraulic_sysid.diagnosis.search.recording_fits import together
from hydraulic_sysid.diagnosis.search.remainder import Remainder, immaterial
from hydraulic_sysid.diagnosis.search.search import Search
from hydraulic_sysid.diagnosis.search.set_aside import accidents
from hydraulic_sysid.diagnosis.search.verdict import set_aside_sentences
from hydraulic_sysid.estimation.fit import FitSettings, fit_segments
from hydraulic_sysid.estimation.levenberg_marquardt import Exact, NormalEquations, minimise
from hydraulic_sysid.estimation.noise import robust_noise_std
from hydraulic_sysid.estimation.noise_model import ChannelNoise
from hydraulic_sysid.estimation.parallel import lazy, processors, results
from hydraulic_sysid.estimation.parameters import Parameters
from hydraulic_sysid.estimation.projection import Projection
from hydraulic_sysid.estimation.recording import Reading
from hydraulic_sysid.estimation.refinement import but_accidents, outlying
from hydraulic_sysid.estimation.segments import cut
from hydraulic_sysid.estimation.shooting import better_of

Array = np.ndarray

DT = 1e-3
TIME = DT * np.arange(400)


@pytest.mark.parametrize("delay", [2.0e-3, -3.0e-3, 0.3e-3, -0.4e-3, 1.5e-3, 7.7e-3])
def test_a_delayed_sine_is_the_sine_of_an_earlier_time(delay: float) -> None:
    wave = np.sin(2.0 * np.pi * 5.0 * TIME)[None]
    found = Reading(delay=delay).applied(wave, DT)
    inside = slice(10, -10)
    assert np.allclose(found[0, inside], np.sin(2.0 * np.pi * 5.0 * (TIME - delay))[inside], atol=3e-6)


@pytest.mark.parametrize("delay", [2.0e-3, -3.0e-3, 0.3e-3, 1.5e-3])
def test_a_delayed_ramp_is_one_to_both_its_ends(delay: float) -> None:
    assert np.allclose(Reading(delay=delay).applied(3.0 * TIME[None], DT), 3.0 * (TIME - delay)[None], atol=1e-12)


def test_a_low_pass_delays_a_ramp_by_its_time_constant() -> None:
    assert np.allclose(Reading(lag=4e-3).applied(3.0 * TIME[None], DT), 3.0 * (TIME - 4e-3)[None], atol=1e-12)


def test_a_low_pass_of_a_sine_has_the_gain_and_phase_of_its_corner() -> None:
    lag, omega = 4e-3, 2.0 * np.pi * 10.0
    found = Reading(lag=lag).applied(np.sin(omega * TIME)[None], DT)[0]
    response = 1.0 / (1.0 + 1j * omega * lag)
    settled = slice(100, None)
    assert np.allclose(found[settled], np.imag(response * np.exp(1j * omega * TIME))[settled], atol=1e-3)


def test_a_low_pass_and_a_delay_follow_each_other() -> None:
    both = Reading(delay=2e-3, lag=4e-3).applied(3.0 * TIME[None], DT)
    assert np.allclose(both, 3.0 * (TIME - 6e-3)[None], atol=1e-12)


def test_nuisance_is_projected_as_dense_algebra_says() -> None:
    """Initial states are free, nuisance has unit variance: what is left costs rᵀ(I + NNᵀ + ∞·JJᵀ)⁻¹r."""
    draw = np.random.default_rng(0)
    raw = draw.standard_normal((2, 30))
    jacobian, nuisance = draw.standard_normal((2, 30, 3)), draw.standard_normal((2, 30, 4))
    found = Projection.of(raw, jacobian, nuisance)
    columns = draw.standard_normal((2, 30, 2))
    for s in range(2):
        covariance = np.eye(30) + nuisance[s] @ nuisance[s].T
        weight = np.linalg.inv(covariance)
        j = jacobian[s]
        weight -= weight @ j @ np.linalg.solve(j.T @ weight @ j, j.T @ weight)
        assert found.residual[s] @ found.residual[s] == pytest.approx(raw[s] @ weight @ raw[s], rel=1e-6)
        beyond = found.beyond(columns)[s]
        assert np.allclose(beyond.T @ beyond, columns[s].T @ weight @ columns[s], rtol=1e-6)
        assert np.allclose(beyond.T @ found.residual[s], columns[s].T @ weight @ raw[s], rtol=1e-6)
        change = -np.linalg.solve(j.T @ np.linalg.solve(covariance, j), j.T @ np.linalg.solve(covariance, raw[s]))
        assert np.allclose(found.correction[s] @ raw[s], change, rtol=1e-6)


def test_without_nuisance_only_the_initial_states_are_taken() -> None:
    draw = np.random.default_rng(1)
    raw, jacobian = draw.standard_normal((1, 30)), draw.standard_normal((1, 30, 3))
    found = Projection.of(raw, jacobian, np.zeros((1, 30, 0)))
    best, *_ = np.linalg.lstsq(jacobian[0], raw[0], rcond=None)
    assert np.allclose(found.residual[0], raw[0] - jacobian[0] @ best, atol=1e-5)


def test_of_two_initial_states_that_counts_which_leaves_less_beyond_the_nuisance() -> None:
    """One may ask the nuisance for much, as hum does: by the sum of squares alone no initial state would get there."""
    draw = np.random.default_rng(3)
    hum, noise = 20.0 * draw.standard_normal((1, 30, 1)), draw.standard_normal((1, 30))
    found = Projection.of(noise, draw.standard_normal((1, 30, 3)), hum)
    far, near = found.with_raw(5.0 * noise), found.with_raw(noise + 2.0 * hum[..., 0])
    assert np.sum(near.raw**2) > 10.0 * np.sum(far.raw**2)
    states, left = better_of(([np.zeros((1, 4))], [far]), ([np.ones((1, 4))], [near]))
    assert states[0].min() == 1.0 and np.array_equal(left[0].raw, near.raw)
    lost = found.with_raw(np.full((1, 30), 1e200))
    states, _ = better_of(([np.zeros((1, 4))], [far]), ([np.ones((1, 4))], [lost]))
    assert states[0].max() == 0.0, "a run that leaves all bounds"


class Line(Exact):
    """A linear fit y = A·x with what is known of x beforehand."""

    def __init__(self, a: Array, y: Array, parameters: Parameters) -> None:
        self.a, self.y, self.parameters = a, y, parameters

    @property
    def left(self) -> Array:
        return self.a @ self.parameters.values - self.y

    @property
    def cost(self) -> float:
        return float(self.left @ self.left) + self.parameters.prior_cost

    @property
    def normal(self) -> NormalEquations:
        columns = self.a * self.parameters.scales
        information = columns.T @ columns + np.diag(self.parameters.prior_information)
        return NormalEquations(information, ((columns * self.left[:, None]),), self.parameters.prior_gradient)

    def moved(self, change: Array) -> Line:
        return Line(self.a, self.y, self.parameters.moved(change))


def test_a_fit_with_priors_ends_where_the_closed_form_says() -> None:
    draw = np.random.default_rng(2)
    a, y = draw.standard_normal((40, 3)), draw.standard_normal(40)
    mean, std = np.array([1.0, -2.0, 0.0]), np.array([0.1, 0.5, np.inf])
    begin = Parameters.unbounded(np.array([3.0, 3.0, 3.0]))
    begin = replace(begin, mean=mean, std=std, scales=np.array([1.0, 10.0, 0.1]))
    found = minimise(Line(a, y, begin), 50, 0.0, 1e-6).point.parameters
    ridge = np.diag(std**-2.0)
    exact = np.linalg.solve(a.T @ a + ridge, a.T @ y + ridge @ mean)
    assert np.allclose(found.values, exact, atol=1e-6)
    assert begin.prior_cost == pytest.approx((2.0 / 0.1) ** 2 + (5.0 / 0.5) ** 2)


@dataclass(frozen=True)
class Bend:
    """Residuals x + x³/3 − y of many values; derivatives are carried on from point to point."""

    parameters: Parameters
    y: Array
    derived: float | None = None
    taken: ClassVar[int] = 0
    steps: ClassVar[int] = 0

    @property
    def left(self) -> Array:
        x = self.parameters.values[0]
        return np.asarray(x + x**3 / 3.0 - self.y)

    @property
    def cost(self) -> float:
        return float(self.left @ self.left)

    @property
    def exact(self) -> bool:
        return self.derived is None

    @cached_property
    def slope(self) -> float:
        if self.derived is not None:
            return self.derived
        Bend.taken += 1
        return float(1.0 + self.parameters.values[0] ** 2)

    @property
    def normal(self) -> NormalEquations:
        columns = np.full((self.y.size, 1), self.slope)
        return NormalEquations(columns.T @ columns, (columns * self.left[:, None],))

    def moved(self, change: Array) -> Bend:
        Bend.steps += 1
        return replace(self, parameters=self.parameters.moved(change), derived=self.slope)

    def made_exact(self) -> Bend:
        return replace(self, derived=None)


def test_derivatives_are_carried_on_but_no_fit_ends_by_them() -> None:
    y = 1.0 + 1e-3 * np.random.default_rng(4).standard_normal(50)
    found = minimise(Bend(Parameters.unbounded(np.array([1.2])), y), 50, 1e-12)
    x = found.point.parameters.values[0]
    assert found.converged and found.point.exact
    assert x + x**3 / 3.0 == pytest.approx(y.mean(), abs=1e-8)
    assert Bend.taken == found.iterations < Bend.steps


def test_workers_do_all_that_is_asked_for() -> None:
    def inner(number: int) -> str:
        return threading.current_thread().name

    def outer(number: int) -> tuple[str, set[str]]:
        return threading.current_thread().name, set(results(inner, range(5)))

    found = list(results(outer, range(20)))
    names = {name for own, others in found for name in (own, *others)}
    assert threading.current_thread().name not in names
    assert len(names) <= processors.usable()


def test_what_is_lazy_holds_no_lock() -> None:
    """Two objects at once: each waits in its own for the other's."""
    both = threading.Barrier(2)

    class One:
        @lazy
        def value(self) -> int:
            return both.wait(timeout=30.0)

    ones = One(), One()
    threads = [threading.Thread(target=lambda one=one: one.value) for one in ones]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(one.value for one in ones) == [0, 1]


def hypothesis(name: str) -> Hypothesis:
    return next(h for h in HYPOTHESES if h.name == name)


@pytest.mark.parametrize(
    ("size", "begun_at"),
    [(-0.45e-3, [-1e-3, -0.45e-3]), (2.6e-3, [3e-3, 2.6e-3]), (0.2e-3, [1e-3, 0.2e-3]), (-1.02e-3, [-1.02e-3])],
)
def test_a_delay_is_begun_from_whole_sampling_intervals_too(size: float, begun_at: list[float]) -> None:
    fault = RecordingFault(hypothesis("pressures"), size, 1e-6, 1.0)
    assert [f.size for f in fault.starts(DT)] == pytest.approx(begun_at)


def test_a_gain_and_a_low_pass_are_begun_where_they_were_found() -> None:
    for name in ("pressure_a_gain", "pressures_low_pass"):
        fault = RecordingFault(hypothesis(name), 0.004, 1e-6, 1.0)
        assert fault.starts(DT) == [fault]


def test_a_low_pass_is_sized_without_the_small_delays_that_hid_a_part_of_it() -> None:
    segments = cut([simulated({}, 2.0)], "hydraulic", 0.5, False)[0]
    hidden = replace(segments, readings=(Reading(delay=-3e-4), *[Reading(delay=3.5e-4, named=1e-4)] * 2))
    (found,) = RecordingFault(hypothesis("pressures_low_pass"), 2e-3, 1e-6, 1.0).on([hidden])
    assert found.readings == (Reading(), *[Reading(delay=1e-4, named=1e-4, lag=2e-3)] * 2)
    (scaled,) = RecordingFault(hypothesis("pressure_a_gain"), 0.02, 1e-6, 1.0).on([hidden])
    assert [r.delay for r in scaled.readings] == [r.delay for r in hidden.readings]


@pytest.mark.parametrize(
    ("over_noise", "share", "nothing"),
    [(1.05, 4e-3, True), (1.05, 6e-3, False), (20.0, 9e-4, True), (20.0, 2e-3, False)],
)
def test_what_matters_depends_on_the_motion_however_quiet_the_sensors(
    over_noise: float, share: float, nothing: bool
) -> None:
    left = [Remainder("position", share * 0.01, 1e-6, 0.01), Remainder("pressure_a", 0.0, 1.0, 1e5)]
    misfit = Misfit(1000.0 * over_noise**2, 500.0 * over_noise**2, 1000, 500)
    assert immaterial(misfit, left) == nothing


def simulated(values: Mapping[str, float], seconds: float = 4.0) -> Record:
    """The sample bench with these values, white noise on its sensors, driven by random steps."""
    plant = Plant(load_model("sample_bench").with_values(values))
    draw = np.random.default_rng(7)
    drive = np.repeat(draw.uniform(-4.0, 4.0, round(seconds / 0.25)), 250)
    run = plant.simulate(drive, DT, plant.initial_state())
    noise = {"position": 2e-5, "pressure_a": 1.5e4, "pressure_b": 1.5e4}
    seen = {c: np.asarray(getattr(run, c)) + n * draw.standard_normal(drive.size) for c, n in noise.items()}
    return Record.sampled("simulated", DT, {"drive": drive, **seen})


def test_a_prior_holds_a_parameter_as_firmly_as_it_says() -> None:
    segments = cut([simulated({"moving_mass": 500.0})], "hydraulic", 0.5)
    plant = Plant(load_model("sample_bench"))
    free = fit_segments(plant, segments, ["moving_mass"], FitSettings()).point
    known = fit_segments(plant, segments, ["moving_mass"], FitSettings(), priors={"moving_mass": (450.0, 1.0)}).point
    (information,) = np.diag(free.normal.information) / free.parameters.scales**2
    expected = (information * free.parameters.values[0] + 450.0) / (information + 1.0)
    assert free.parameters.values[0] == pytest.approx(500.0, rel=0.02)
    assert known.parameters.values[0] == pytest.approx(expected, rel=0.01)


def test_the_beginning_of_a_record_is_not_judged() -> None:
    (segments,) = cut([simulated({})], "hydraulic", 0.5)
    assert segments.first[0] == 100
    assert segments.counted.tolist() == [3 * segments.samples] * len(segments)


def test_another_noise_judges_the_same_deviations() -> None:
    (segments,) = cut([simulated({})], "hydraulic", 0.5)
    judged = segments.with_noise([ChannelNoise.white(2.0 * n.std) for n in segments.noise])
    run = segments.measured + 1.0
    none = np.zeros((len(segments), len(segments.free)))
    assert np.allclose(2.0 * judged.deviation(run, none), segments.deviation(run, none))
    assert np.allclose(judged.in_units(judged.deviation(run, none)), -1.0)
    measured = [k for k, free in enumerate(segments.unmeasured_pressures) if not free and segments.free[k] != 1]
    assert np.allclose(judged.prior_std[:, measured], 2.0 * segments.prior_std[:, measured])


def test_of_one_pressure_in_each_record_both_may_be_late() -> None:
    def shown(*channels: str) -> set[str]:
        return {h.name for h in HYPOTHESES if h.shown_by(set(channels))}

    assert shown("position", "pressure_a", "pressure_b") == {h.name for h in HYPOTHESES}
    of_one = {"pressure_a", "pressure_a_low_pass", "pressure_a_gain"}
    assert shown("position", "pressure_a") == {*of_one, "drive", "position"}
    assert shown("position") == {"position"}


def test_the_levels_of_a_command_are_no_noise_on_it() -> None:
    command = np.repeat([0.0, 3.0, 0.0, -3.0], 500)
    assert robust_noise_std(command, rounded=False) == 0.0 < robust_noise_std(command)


def test_more_of_a_fault_that_was_found_before_is_one_fault() -> None:
    low_pass, other = (next(h for h in HYPOTHESES if h.what == what) for what in ("lag", "delay"))
    first, more = RecordingFault(low_pass, 4e-3, 1e-4, 100.0), RecordingFault(low_pass, 1e-3, 2e-4, 10.0)
    late = RecordingFault(other, 2e-3, 1e-4, 50.0)
    assert together([first, late], more) == [late, RecordingFault(low_pass, 5e-3, 2e-4, 110.0)]
    assert together([first], late) == [first, late]


def test_the_residual_of_a_run_is_that_of_its_parts() -> None:
    """Compiled in one pass: what is recorded of the run, taken off, whitened, without samples that do not count."""
    draw = np.random.default_rng(4)
    channels = {c: draw.standard_normal(1000).cumsum() for c in ("drive", "position", "pressure_a", "pressure_b")}
    (segments,) = cut([Record.sampled("r", DT, channels)], "hydraulic", 0.2)
    noise = [ChannelNoise(np.array([1.0, -0.5]), 0.3, np.array([0.12, 0.06])), *segments.noise[1:]]
    outliers = np.zeros_like(segments.outliers)
    outliers[1, 30, 0] = outliers[0, 5:7, 2] = True
    readings = (Reading(delay=0.4e-3), Reading(delay=-2.3e-3, lag=3e-3, gain=0.02), Reading())
    loudness = draw.uniform(0.5, 2.0, segments.loudness.shape)
    segments = replace(segments.with_noise(noise), outliers=outliers, readings=readings, loudness=loudness)
    run = segments.measured + draw.standard_normal(segments.measured.shape)
    priors = np.ones((len(segments), len(segments.free)))
    parts = segments.whitened(segments.measured - segments.recorded(run))
    assert np.allclose(segments.deviation(run, priors), np.concatenate((parts, priors), axis=1), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("far", "left_out"), [(0, 0), (1, 1), (2, 2), (3, 0), (8, 0)])
def test_only_what_may_be_an_accident_is_set_aside(far: int, left_out: int) -> None:
    """Of a hundred segments two may be; where more are far off something acts there."""
    squares = np.ones(100)
    squares[50 : 50 + far] = 1e3
    near = ~outlying(squares, squares)
    found = but_accidents([near[:40], near[40:]])
    assert [len(f) for f in found] == [40, 60]
    assert int(np.sum(~np.concatenate(found))) == left_out


def test_one_segment_of_few_may_be_an_accident_and_is_named() -> None:
    (segments,) = cut([simulated({}, seconds=8.0)], "hydraulic", 0.5)
    near = np.arange(len(segments)) != 2
    (kept,) = but_accidents([near])
    assert np.flatnonzero(~kept).tolist() == [2]
    after = Split([segments], [np.ones(len(segments), dtype=bool)]).judged([segments], [kept])
    assert len(after.segments[0]) == len(segments) - 1
    (left_out,) = after.far_off
    (aside,) = accidents(left_out, np.ones(1, dtype=bool))
    assert (aside.record, aside.reason) == ("simulated", "far off")
    assert aside.time == pytest.approx(segments.first[2] * DT) and aside.seconds == pytest.approx(0.5, rel=0.05)
    assert "of simulated are far off all else, from" in set_aside_sentences([aside])[0]
    assert not accidents(left_out, np.zeros(1, dtype=bool))  # what was found explains it


def test_accidents_that_become_many_are_none() -> None:
    """Left out one by one, all segments in which a limit acts would pass for accidents."""
    (segments,) = cut([simulated({}, seconds=8.0)], "hydraulic", 0.5)
    whole = Split([segments], [np.arange(len(segments)) % 3 > 0])
    far = np.arange(len(segments)) == 2
    without = whole.judged([segments], [~far])
    late = replace(without.segments[0].readings[0], delay=1e-4)
    judged = replace(without.segments[0], readings=(late, *segments.readings[1:]))
    back = without.judged([judged], [~far[1:]])
    assert len(back) == len(segments) and not back.far_off
    assert back.fit[0].tolist() == whole.fit[0].tolist()
    assert back.segments[0].readings == judged.readings
    kept = without.judged([judged], [np.ones(len(judged), dtype=bool)])
    assert len(kept) == len(segments) - 1 and len(kept.far_off[0]) == 1


@pytest.mark.parametrize("acts", [[6, 7, 8], [0, 1, 4, 9]])
def test_what_shows_in_segments_of_one_role_is_shared_out_to_both(acts: list[int]) -> None:
    (segments,) = cut([simulated({}, seconds=8.0)], "hydraulic", 0.5)
    fit = ~np.isin(np.arange(len(segments)), [6, 7, 8])
    squares = np.ones(len(segments))
    squares[acts] = 20.0
    (shared,) = Split([segments], [fit]).shared_out([squares]).fit
    much = squares > 2.0
    assert 0 < np.count_nonzero(shared[much]) < len(acts)
    assert (shared[~much] == fit[~much]).all()


class Silent:
    """Progress of which nothing is told."""

    def __call__(self, trying: str) -> None:
        """Nothing."""

    def reached(self, *_: object) -> None:
        """Nothing."""


@pytest.mark.parametrize("hidden", [True, False])
def test_what_wrong_numbers_do_where_it_was_fitted_is_shared_out_after_they_were_found(
    monkeypatch: pytest.MonkeyPatch, hidden: bool
) -> None:
    """A limit of the valve that only segments for validation reach looks like other areas to all others."""
    fits, given = object.__new__(Search), load_model("sample_bench")
    asked, loosened = list[str](), list[str]()

    def state(model: Any, *_: object) -> Any:
        return SimpleNamespace(model=given, misfit=None, name="strict")

    def loose(strict: Any) -> Any:
        loosened.append(strict.name)
        return SimpleNamespace(model=given, misfit=None, name=f"loose {len(loosened)}")

    def shared_out(state: Any) -> bool:
        asked.append(state.name)
        return hidden and state.name == "loose 1"

    for name, function in {"state": state, "loosened": loose, "shared_out": shared_out}.items():
        monkeypatch.setattr(fits, name, function, raising=False)
    own = {"given": given, "say": Silent(), "_first": FitSettings(), "judged": lambda state: state}
    for name, value in own.items():
        monkeypatch.setattr(fits, name, value, raising=False)
    found: Any = fits.begin()
    assert asked == ["strict", "loose 1"]
    assert found.name == ("loose 2" if hidden else "loose 1")


@pytest.mark.parametrize(("acts", "mixed"), [([4, 5, 6], True), ([], True), ([6, 7, 8], False)])
def test_roles_stay_where_both_see_what_is_missing_or_records_were_named(acts: list[int], mixed: bool) -> None:
    (segments,) = cut([simulated({}, seconds=8.0)], "hydraulic", 0.5)
    fit = ~np.isin(np.arange(len(segments)), [6, 7, 8])
    squares = np.ones(len(segments))
    squares[acts] = 20.0
    split = Split([segments, segments], [fit, fit] if mixed else [np.ones_like(fit), np.zeros_like(fit)])
    assert split.shared_out([squares, squares]) is split
