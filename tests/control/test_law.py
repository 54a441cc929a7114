"""The control law: nonlinear gain, filters, limits, anti-windup, bumpless changes, and what nobody should send it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hydraulic_control import polynomials as pole_placement
from hydraulic_control.controller import Controller
from hydraulic_control.laws.npid import nonlinear_gain
from hydraulic_control.parameters import CONTROLLERS, LAW
from hydraulic_interfaces.errors import HydraulicError

DT = 1e-3
PLAIN = {"bumpless_time": 1e-3, "slew_limit": 1e6, "integral_zone": 0.0, "integral_limit": 10.0}


def settled(controller: Controller, e: float, count: int = 50) -> float:
    """Drive after some samples of a constant error, once the start's offset has decayed."""
    for _ in range(count):
        controller.step(DT, e, 0.0, 0.0)
    return controller.drive


@pytest.mark.parametrize("e", [0.0, 1e-300, 1e-6, 0.05, -0.05, 3.0, 1e6, -1e300, math.inf])
def test_the_gain_is_the_papers(e: float) -> None:
    with np.errstate(over="ignore"):
        sech = 1.0 / np.cosh(50.0 * e)
    assert nonlinear_gain(e, 1.0, 3.0, 50.0) == pytest.approx(4.0 - 3.0 * sech, rel=1e-12)


def test_k2_of_the_paper_is_per_millimetre() -> None:
    for millimetres in (1.0, 20.0, 50.0):
        printed = 4.0 - 3.0 / math.cosh(0.05 * millimetres)
        defaults = {spec.name: spec.default for spec in LAW}
        ours = nonlinear_gain(1e-3 * millimetres, defaults["k0"], defaults["k1"], defaults["k2"])
        assert ours == pytest.approx(printed)


def test_npid_is_its_formula() -> None:
    law = Controller({**PLAIN, "kp": 20.0, "ki": 5.0})
    e = 0.03
    drive = settled(law, e, 100)
    k = 4.0 - 3.0 / math.cosh(50.0 * e)
    assert drive == pytest.approx(k * (20.0 * e + 5.0 * e * 99 * DT), rel=1e-6)


def test_pid_is_npid_without_the_gain() -> None:
    assert settled(Controller({**PLAIN, "controller": "pid", "kp": 20.0}), 0.03) == pytest.approx(0.6, rel=1e-6)


def test_the_derivative_is_that_of_the_measurement() -> None:
    law = Controller({**PLAIN, "controller": "pid", "kp": 0.0, "kd": 2.0, "derivative_time": 0.01})
    for i in range(200):
        drive = law.step(DT, 0.0, 0.0, 0.1 * i * DT)
    assert drive == pytest.approx(-0.2, rel=1e-3)
    kicked = law.step(DT, 1.0, 0.0, 0.1 * 200 * DT)
    assert kicked == pytest.approx(-0.2, rel=1e-3), "a step of the reference is not differentiated"


def test_the_derivative_filter_has_its_time_constant() -> None:
    law = Controller({**PLAIN, "controller": "pid", "kp": 0.0, "kd": 1.0, "derivative_time": 0.05})
    law.step(DT, 0.0, 0.0, 0.0)
    drives = [law.step(DT, 0.0, 0.0, i * DT) for i in range(1, 51)]
    assert drives[-1] == pytest.approx(-(1.0 - math.exp(-1.0)), rel=0.02)


def test_dynamic_pressure_feedback_acts_against_changes_only() -> None:
    law = Controller({**PLAIN, "controller": "pid", "kp": 0.0, "force_feedback": 1e-4, "force_time": 0.01})
    law.step(DT, 0.0, 0.0, 0.0, 1000.0)
    jumped = law.step(DT, 0.0, 0.0, 0.0, 6000.0)
    assert jumped == pytest.approx(-0.5, rel=1e-6)
    for _ in range(200):
        left = law.step(DT, 0.0, 0.0, 0.0, 6000.0)
    assert abs(left) < 1e-4
    assert law.step(DT, 0.0, 0.0, 0.0, math.nan) == pytest.approx(0.0, abs=1e-4), "works without transducers"


def test_velocity_feed_forward_and_dead_band() -> None:
    law = Controller({**PLAIN, "kp": 0.0, "velocity_feedforward": 20.0})
    for _ in range(50):
        drive = law.step(DT, 0.0, 0.1, 0.0)
    assert drive == pytest.approx(2.0, rel=1e-6)
    jump = Controller({**PLAIN, "controller": "pid", "kp": 10.0, "deadband": 0.3, "deadband_width": 0.01})
    assert settled(jump, 0.05) == pytest.approx(0.8, rel=1e-6)
    assert settled(jump, -0.05, 50) == pytest.approx(-0.8, rel=1e-6)
    assert abs(settled(jump, 1e-4, 50)) < 0.05, "spread, not a relay"


def test_limits_of_drive_and_slew() -> None:
    law = Controller({"kp": 1e4, "drive_limit": 4.0, "slew_limit": 100.0})
    drives = [law.step(DT, 0.5, 0.0, 0.0) for _ in range(200)]
    assert max(drives) == 4.0
    assert max(np.diff([0.0, *drives])) <= 0.1 + 1e-12


@pytest.mark.parametrize("strategy", ["back_calculation", "conditional_integration"])
def test_anti_windup(strategy: str) -> None:
    """After five seconds against the limit the drive turns round with the error; without it, it does not."""

    def turns(antiwindup: str) -> int:
        law = Controller(
            {**PLAIN, "controller": "pid", "kp": 20.0, "ki": 100.0, "antiwindup": antiwindup, "drive_limit": 1.0}
        )
        settled(law, 0.1, 5000)
        drives = [law.step(DT, -0.02, 0.0, 0.0) for _ in range(5000)]
        return int(np.argmax(np.array(drives) < 0.0)) if min(drives) < 0.0 else 5000

    assert turns(strategy) < 50
    assert turns("none") > 1000


def test_the_integral_is_limited_and_fades_with_the_error() -> None:
    law = Controller({**PLAIN, "controller": "pid", "kp": 0.0, "ki": 100.0, "integral_limit": 0.5})
    assert settled(law, 0.1, 1000) == pytest.approx(0.5)
    fading = Controller({**PLAIN, "controller": "pid", "kp": 0.0, "ki": 100.0, "integral_zone": 1e-3})
    far = settled(fading, 0.1, 1001)
    assert far == pytest.approx(100.0 * 0.1 / (1.0 + 1e4), rel=1e-3)
    fading.stop()
    assert settled(fading, 1e-3, 1001) == pytest.approx(100.0 * 0.5e-3, rel=1e-3), "half at the zone"


def test_starting_joins_on_to_the_applied_drive() -> None:
    law = Controller({"controller": "pid", "kp": 100.0})
    law.stop(1.5)
    assert law.step(DT, 0.08, 0.0, 0.0) == pytest.approx(1.5)
    drives = [law.step(DT, 0.08, 0.0, 0.0) for _ in range(1000)]
    assert max(np.abs(np.diff([1.5, *drives]))) < 0.1
    assert drives[-1] == pytest.approx(8.0, rel=1e-2)


@pytest.mark.parametrize(
    "change",
    [{"kp": 90.0}, {"k1": 0.5}, {"ki": 500.0}, {"controller": "pid"}, {"controller": "pole_placement"}, {"kd": 5.0}],
    ids=str,
)
def test_changes_make_no_bump(change: dict[str, float | str]) -> None:
    law = Controller({"kp": 40.0, "ki": 30.0, "kd": 0.5})
    for i in range(300):
        before = law.step(DT, 0.05, 0.0, 0.02 + 1e-6 * i)
    law.set(change)
    after = law.step(DT, 0.05, 0.0, 0.02 + 1e-6 * 300)
    assert after == pytest.approx(before, abs=0.02)
    for i in range(3000):
        later = law.step(DT, 0.05, 0.0, 0.02 + 1e-6 * 301 + 1e-9 * i)
    assert abs(later - before) > 0.02, "and then the new values act"


def test_what_is_refused_names_the_value_and_changes_nothing() -> None:
    law = Controller()
    for values, complaint in (
        ({"kp": -1.0}, "kp is -1"),
        ({"kp": math.nan}, "kp is nan"),
        ({"gain": 1.0}, "no parameter"),
        ({"controller": "lqr"}, "pole_placement"),
        ({"antiwindup": "some"}, "conditional_integration"),
        ({"controller": "pole_placement", "pole_placement.period": 0.5}, "Nyquist"),
    ):
        with pytest.raises(HydraulicError, match=complaint):
            law.set(values)
    assert law.values["kp"] == Controller().values["kp"]
    assert settled(law, 0.01) == settled(Controller(), 0.01)


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=80, deadline=None)
@given(
    law=st.sampled_from(CONTROLLERS),
    strategy=st.sampled_from(["none", "back_calculation", "conditional_integration"]),
    samples=st.lists(st.tuples(numbers, numbers, numbers, numbers, numbers), min_size=1, max_size=30),
    gains=st.tuples(st.floats(0.0, 1e5), st.floats(0.0, 1e6), st.floats(0.0, 1e4), st.floats(0.0, 1e5)),
)
def test_no_input_gets_a_drive_that_is_not_one(law, strategy, samples, gains) -> None:  # type: ignore[no-untyped-def]
    kp, ki, kd, k2 = gains
    controller = Controller({"controller": law, "antiwindup": strategy, "kp": kp, "ki": ki, "kd": kd, "k2": k2})
    controller.set({"force_feedback": 1.0, "velocity_feedforward": 1e3})
    for dt, reference, velocity, position, force in samples:
        for step in (dt, DT):
            drive = controller.step(step, reference, velocity, position, force)
            assert math.isfinite(drive) and abs(drive) <= 10.0
    for _ in range(3):
        assert math.isfinite(controller.step(DT, 0.01, 0.0, 0.0, 0.0)), "and it recovers"


class TestPolePlacement:
    """The polynomials of the peer."""

    def test_the_sampled_model_is_that_of_the_library(self) -> None:
        import control

        b, a = pole_placement.sampled_model(0.0434, 0.02, 0.01)
        sampled = control.sample_system(control.tf([0.0434], [0.02, 1.0, 0.0]), 0.01)
        assert a == pytest.approx(sampled.den[0][0], rel=1e-9)
        assert b == pytest.approx(sampled.num[0][0][-2:], rel=1e-6)

    def test_the_closed_loop_has_the_poles(self) -> None:
        values = {"velocity_gain": 0.0434, "lag": 0.005, "frequency": 12.0, "damping": 0.8, "observer": 40.0}
        p = pole_placement.design(**values, period=0.01)
        b, a = pole_placement.sampled_model(0.0434, 0.005, 0.01)
        closed = np.polyadd(np.polymul(a, [1.0, p.r1, p.r2]), np.polymul(b, [p.s0, p.s1, p.s2]))
        s = np.log(np.roots(closed).astype(complex)) / 0.01
        wanted = np.array([*np.roots([1.0, 2 * 0.8 * 12.0, 144.0]), -40.0, -40.0])
        key = lambda z: (round(z.real, 2), z.imag)  # noqa: E731
        assert sorted(s, key=key) == pytest.approx(sorted(wanted, key=key), rel=1e-3, abs=2e-2)
        assert 1.0 + p.r1 + p.r2 == pytest.approx(0.0, abs=1e-12), "integral action"

    def test_it_follows_its_own_model_without_error_despite_a_bias(self) -> None:
        law = Controller({"controller": "pole_placement", "bumpless_time": 1e-3, "slew_limit": 1e6})
        x = v = 0.0
        trace = []
        for _ in range(3000):
            u = law.step(DT, 0.01, 0.0, x)
            v += DT / 5e-3 * (0.0434 * (u + 0.2) - v)
            x += DT * v
            trace.append(x)
        assert trace[-1] == pytest.approx(0.01, abs=1e-6)
        assert max(trace) < 0.0125
