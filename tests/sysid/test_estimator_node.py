"""The estimator as a process beside a simulated plant: what it publishes is what the pure parts make of the states."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402

from hydraulic_interfaces.contract import topic  # noqa: E402
from hydraulic_interfaces.conversions import command_to_message, from_time, sample_from_messages  # noqa: E402
from hydraulic_interfaces.qos import profile  # noqa: E402
from hydraulic_interfaces.samples import Command  # noqa: E402
from hydraulic_sysid.linear.models import ArxOrder, read_linear_model  # noqa: E402

NODE = "/actuator/estimator"
PERIOD_NS = 20_000_000
RATE = 250.0  # low, so that the collecting test process keeps up on a busy machine
TOPICS = ("predicted_state", "residual", "model_parameters", "model_poles", "model_fit")


def stamps(messages: list[Any]) -> list[int]:
    return [from_time(m.header.stamp) for m in messages]


class Bench:
    """Plant, estimator and a source that wiggles the drive.

    In lockstep: a command is sent when the estimator has taken the state that it answers, so that a busy machine makes
    neither of the two lose one.
    """

    def __init__(self, launch: Any, client: Any, wait_until: Any) -> None:
        self.client, self.wait_until = client, wait_until
        self.states = client.collect("state")
        self.heard = {name: client.collect(name) for name in TOPICS}
        self._launch = launch
        self._command = client.publisher("command")
        client.node.create_subscription(JointState, topic("residual"), self._answer, profile("residual", 5000))

    def start(self, *options: str) -> Any:
        plant = ("enable_on_activate:=true", f"rate:={RATE}", "lockstep:=true", "position_noise:=2e-5")
        settings = [part for setting in plant for part in ("-p", setting)]
        self._launch("hydraulic_sim.nodes.simulator", "--autostart", "--ros-args", *settings)
        process = self._launch("hydraulic_sysid.nodes.estimator", "--ros-args", *options)
        self.wait_until(lambda: self.heard["residual"], "a residual")
        return process

    def _answer(self, residual: JointState) -> None:
        """Random drives, another one every 0.1 s; the residual of a state is told with the next."""
        stamp_ns = from_time(residual.header.stamp) + round(1e9 / RATE)
        drive = np.random.default_rng(stamp_ns // 100_000_000).uniform(-2.0, 2.0)
        self._command.publish(command_to_message(Command(stamp_ns, "test", float(drive))))

    def coefficients(self, count: int) -> None:
        """Wait until that many sets of coefficients have come since every topic has been heard."""
        self.wait_until(lambda: self.states and all(self.heard.values()), "every topic")
        heard = self.heard["model_parameters"]
        seen = len(heard)
        self.wait_until(lambda: len(heard) >= seen + count, f"{count} sets of coefficients")

    def set_forgetting(self, value: float) -> Any:
        number = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        answer = self.client.call(
            "rcl_interfaces/srv/SetParameters",
            f"{NODE}/set_parameters",
            parameters=[Parameter(name="forgetting", value=number)],
        )
        return answer.results[0]


@pytest.fixture
def bench(launch: Any, client: Any, wait_until: Any, compiled_physics: None) -> Bench:
    return Bench(launch, client, wait_until)


def test_the_topics_carry_what_the_pure_parts_make_of_the_states(bench: Bench, tmp_path: Path) -> None:
    file = tmp_path / "model.json"
    process = bench.start("-p", "sampling_time:=0.02", "-p", "na:=2", "-p", "nb:=2", "-p", f"save_to:={file}")
    rows: list[Any] = bench.client.collect("diagnostics")
    bench.coefficients(100)
    heard = {name: list(messages) for name, messages in bench.heard.items()}

    # The physical model: measured = predicted + residual, at the stamps of the states.
    states = {from_time(m.header.stamp): m for m in bench.states}
    residuals = {from_time(m.header.stamp): m for m in heard["residual"]}
    both = [m for m in heard["predicted_state"] if (s := from_time(m.header.stamp)) in states and s in residuals]
    assert len(both) > 100
    for predicted in both:
        stamp = from_time(predicted.header.stamp)
        measured, residual = states[stamp], residuals[stamp]
        assert predicted.name == measured.name
        assert residual.position[0] == pytest.approx(measured.position[0] - predicted.position[0], abs=1e-12)
        assert residual.effort[1] == 0.0  # the drive is that which was applied
    # The plant is the model: what is left is the sensor's noise and a little from each start.
    assert np.sqrt(np.mean([m.position[0] ** 2 for m in heard["residual"]])) < 5e-4

    def rms() -> float:
        said = [
            pair.value for m in rows for r in m.status for pair in r.values if pair.key == "position_residual_rms_m"
        ]
        return float(said[-1]) if said else math.nan

    bench.wait_until(lambda: 0.0 < rms() < 5e-4, "the same in the diagnostics")

    # The linear model: coefficients, poles and fit of one instant belong together.
    poles, fit = heard["model_poles"][-1], heard["model_fit"][-1]
    poles_at = {from_time(m.header.stamp): m for m in heard["model_poles"]}
    last = next(m for m in heard["model_parameters"][::-1] if from_time(m.header.stamp) in poles_at)
    assert list(last.name) == ["a1", "a2", "b1", "b2", "c"]
    same = poles_at[from_time(last.header.stamp)]
    z = np.sort_complex(np.array(same.position) + 1j * np.array(same.velocity))
    np.testing.assert_allclose(z, np.sort_complex(np.roots([1.0, *last.position[:2]]).astype(complex)), atol=1e-9)
    assert len(poles.effort) == 2 and fit.effort[0] > 70.0
    assert np.median(np.diff(stamps(heard["model_fit"]))) == PERIOD_NS

    # An integrator shows itself.
    bench.wait_until(lambda: abs(max(bench.heard["model_poles"][-1].position) - 1.0) < 0.02, "an integrator's pole")
    answer = bench.client.call("std_srvs/srv/Trigger", f"{NODE}/save")
    assert answer.success, answer.message
    model, content = read_linear_model(file)
    assert model.order == ArxOrder(2, 2, 1) and model.dt == 0.02
    assert json.loads(file.read_text())["output"] == {"channel": "position", "unit": "m"} == content["output"]
    process.interrupt()
    assert process.wait() == 0


def test_every_prediction_is_that_of_the_coefficients_before_it(bench: Bench) -> None:
    """From the states alone: sampled as a record is, times the coefficients that were published last."""
    bench.start("-p", "sampling_time:=0.02", "-p", "na:=2", "-p", "nb:=2")
    compared = 0
    for _ in range(10):  # a busy machine loses states, and three periods in a row have to be whole
        bench.coefficients(60)
        compared = predictions(bench)
        if compared > 20:
            break
    assert compared > 20


def predictions(bench: Bench) -> int:
    """Compares what was predicted wherever all that it rests on has been heard; how many there were."""
    coefficients = {from_time(m.header.stamp): np.array(m.position) for m in list(bench.heard["model_parameters"])}
    fits = {from_time(m.header.stamp): m for m in list(bench.heard["model_fit"])}
    states = {from_time(m.header.stamp): sample_from_messages(m) for m in list(bench.states)}
    step = round(1e9 / RATE)
    slow: dict[int, tuple[float, float]] = {}
    for end in (stamp for stamp in states if stamp in fits or stamp in coefficients):
        within = [end - PERIOD_NS + k * step for k in range(PERIOD_NS // step)]
        if all(t in states for t in within):
            slow[end] = (float(np.mean([states[t].drive for t in within])), states[end].position)
    compared = 0
    for stamp, fit in fits.items():
        past = [stamp - k * PERIOD_NS for k in (0, 1, 2)]
        if past[1] in coefficients and all(t in slow for t in past):
            regressor = [-slow[past[1]][1], -slow[past[2]][1], slow[past[0]][0], slow[past[1]][0], 1.0]
            assert fit.position[0] == pytest.approx(coefficients[past[1]] @ regressor, abs=1e-9)
            assert fit.velocity[0] == pytest.approx(slow[stamp][1] - fit.position[0], abs=1e-9)
            compared += 1
    return compared


def test_it_can_be_told_to_learn_anew_and_to_forget_faster(bench: Bench) -> None:
    bench.start("-p", "sampling_time:=0.02", "-p", "na:=1", "-p", "nb:=1")
    bench.coefficients(50)
    sure = bench.heard["model_parameters"][-1].velocity[0]
    assert bench.client.call("std_srvs/srv/Trigger", f"{NODE}/reset_covariance").success
    seen = len(bench.heard["model_parameters"])
    # With the covariance the count of samples begins anew: at first no error can be told.
    told = bench.wait_until(lambda: [m.velocity[0] for m in bench.heard["model_parameters"][seen:]][:6], "coefficients")
    assert math.isinf(max(told)) or max(told) > sure
    assert bench.set_forgetting(0.9).successful
    refused = bench.set_forgetting(1.2)
    assert not refused.successful and "1" in refused.reason
    answer = bench.client.call("std_srvs/srv/Trigger", f"{NODE}/save")
    assert not answer.success and "save_to" in answer.message
    rows: list[Any] = bench.client.collect("diagnostics")

    def settled() -> bool:
        said = [r for m in rows for r in m.status if r.name == f"{NODE}: estimate" and "ARX(1, 1, 1)" in r.message]
        return bool(said) and int({pair.key: pair.value for pair in said[-1].values}["updates"]) > 50

    bench.wait_until(settled, "50 updates in the diagnostics")


def test_what_cannot_be_is_refused_at_once(launch: Any) -> None:
    wrong = {"model:=no_such_model": "no such model", "output:=smell": "position, velocity, force"}
    processes = [launch("hydraulic_sysid.nodes.estimator", "--ros-args", "-p", option) for option in wrong]
    for process, words in zip(processes, wrong.values(), strict=True):
        assert process.wait() == 2
        assert words in process.output() and "Traceback" not in process.output()
