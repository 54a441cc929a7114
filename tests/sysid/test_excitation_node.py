"""The excitation node as a process, against a plant node: it plays the plan, and ends for every reason."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue

from hydraulic_interfaces.conversions import from_time
from hydraulic_sysid.excitation import Plan, save_plan
from hydraulic_sysid.excitation.signals.chirp import Chirp

PLANT = Path(__file__).parent / "excitation_plant.py"
RATE = 125.0  # low, so that the collecting test process keeps up on a busy machine
# A loaded machine may hold the node up for longer than the bench's watchdog allows.
PATIENT = ("-p", "watchdog:=1.0")
IN_LOCKSTEP = ("-p", "lockstep:=true")  # however long an answer takes
NODE = "/actuator/excitation"


def short_plan(**changes: Any) -> Plan:
    options = {"travel_limit": 0.5, "centring_gain": 0.0, "fade_in": 0.1, "fade_out": 0.1}
    options |= {"rest_before": 0.2, "rest_after": 0.2, "rate": RATE}
    return Plan("short", Chirp(4.0, 1.0, 10.0, 1.0), **{**options, **changes})


class Bench:
    """Plant and excitation as processes, and what they publish."""

    def __init__(self, launch: Any, client: Any, wait_until: Any, folder: Path) -> None:
        self._launch, self.client, self.wait_until, self._folder = launch, client, wait_until, folder
        self.states = client.collect("state")
        self.commands = client.collect("command")
        self._events = client.collect("experiment")
        self._diagnostics = client.collect("diagnostics")

    def plant(self, *options: str, enabled: bool = True) -> Any:
        enable = ("-p", f"enable_on_activate:={str(enabled).lower()}", "-p", f"rate:={RATE}")
        process = self._launch(PLANT, "--autostart", "--ros-args", *enable, *PATIENT, *options)
        self.wait_until(lambda: self.states, "a state of the plant")
        return process

    def excitation(self, plan: Plan, *options: str, autostart: bool = True, leave: bool = True) -> Any:
        file = self._folder / "plan.yaml"
        save_plan(plan, file)
        values = {"plan": file, "autostart": str(autostart).lower(), "exit_when_done": str(leave).lower()}
        # The test looks for reasons, not for a machine that is fast enough.
        values |= {"state_timeout": "5.0", "listeners": "2"}  # plant and test
        arguments = [word for key, value in values.items() for word in ("-p", f"{key}:={value}")]
        return self._launch("hydraulic_sysid.nodes.excitation", "--ros-args", *arguments, *options)

    def events(self) -> list[dict[str, Any]]:
        return [json.loads(message.data) for message in self._events]

    def event(self, kind: str) -> dict[str, Any]:
        def found() -> list[dict[str, Any]]:
            return [event for event in self.events() if event["event"] == kind]

        return self.wait_until(found, f"the event {kind}")[-1]

    def moving(self) -> None:
        """Wait until the plant applies a drive that can be told from none."""
        self.wait_until(lambda: any(abs(s.effort[1]) > 1.0 for s in self.states), "a moving plant")

    def waits_for(self, what: str) -> None:
        """Wait until the node says that it waits for `what`."""

        def said() -> bool:
            rows = [row for message in self._diagnostics[-20:] for row in message.status]
            return any(row.name.startswith(NODE) and f"waiting for {what}" in row.message for row in rows)

        self.wait_until(said, f"the node to wait for {what}")

    def trouble(self, what: str) -> None:
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=what)
        self.client.call(
            "rcl_interfaces/srv/SetParameters",
            "/actuator/plant/set_parameters",
            parameters=[Parameter(name="trouble", value=value)],
        )


@pytest.fixture
def bench(launch: Any, client: Any, wait_until: Any, tmp_path: Path) -> Bench:
    return Bench(launch, client, wait_until, tmp_path)


def test_a_plan_is_played_to_its_end(bench: Bench) -> None:
    bench.plant(*IN_LOCKSTEP)
    plan = short_plan()
    node = bench.excitation(plan)
    assert node.wait() == 0, node.output()
    finished, started = bench.event("finished"), bench.event("started")
    assert [event["event"] for event in bench.events()] == ["started", "finished"]
    assert started["started_ns"] == finished["started_ns"] == started["stamp_ns"]
    assert Plan.from_mapping(finished["plan"]) == plan == Plan.from_mapping(started["plan"])
    assert finished["reason"] == "" and finished["samples"] == plan.time.size
    assert finished["played"] >= 0.8 * finished["samples"]
    played = 0
    bench.wait_until(lambda: len(bench.commands) > finished["played"], "the last command")
    last = from_time(bench.commands[-1].header.stamp)
    bench.wait_until(lambda: from_time(bench.states[-1].header.stamp) > last, "the states that were answered")
    sampled = {from_time(state.header.stamp): state for state in bench.states}
    for command in bench.commands:
        stamp = from_time(command.header.stamp)
        assert command.header.frame_id == "excitation" and stamp in sampled
        index = round((stamp - started["started_ns"]) * 1e-9 * RATE)
        expected = plan.open_loop[index] if index < plan.time.size else 0.0
        assert command.effort[0] == pytest.approx(expected, abs=1e-12)
        played += index < plan.time.size
    assert played == finished["played"]
    applied = np.array([state.effort[1] for state in bench.states])
    commanded = np.array([command.effort[0] for command in bench.commands])
    assert np.isin(applied, commanded).all()
    assert np.ptp(applied) > 0.8 * np.ptp(commanded) > 5.0


def test_autostart_waits_for_the_plant_to_be_enabled(bench: Bench) -> None:
    bench.plant(*IN_LOCKSTEP, enabled=False)
    node = bench.excitation(short_plan())
    bench.waits_for("the plant to be enabled (it says: active, not enabled)")
    assert not bench.commands and not bench.events()
    assert bench.client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    assert node.wait() == 0, node.output()
    bench.event("finished")


def test_autostart_gives_up_in_time(bench: Bench) -> None:
    bench.plant(enabled=False)
    node = bench.excitation(short_plan(), "-p", "start_timeout:=0.5")
    assert node.wait() == 1
    assert "not started: waited too long for " in node.output()
    assert not bench.commands


def emergency_stop(bench: Bench, plant: Any, node: Any) -> None:
    assert bench.client.call("std_srvs/srv/Trigger", "/actuator/emergency_stop").success


def blind(bench: Bench, plant: Any, node: Any) -> None:
    bench.trouble("blind")


def deaf(bench: Bench, plant: Any, node: Any) -> None:
    bench.trouble("deaf")


def dead(bench: Bench, plant: Any, node: Any) -> None:
    plant.interrupt(signal.SIGKILL)


def sigint(bench: Bench, plant: Any, node: Any) -> None:
    node.interrupt(signal.SIGINT)


def sigterm(bench: Bench, plant: Any, node: Any) -> None:
    node.interrupt(signal.SIGTERM)


@pytest.mark.parametrize(
    ("provoke", "reason"),
    [
        (emergency_stop, "stopped until reset: emergency stop"),
        (blind, "the position is nan"),
        (deaf, "the plant applied 0.000 … 0.000 V"),
        (dead, "no state for"),
        (sigint, "interrupted by SIGINT"),
        (sigterm, "interrupted by SIGTERM"),
    ],
)
def test_a_run_that_goes_wrong_ends_at_zero_and_says_why(bench: Bench, provoke: Any, reason: str) -> None:
    plant = bench.plant()
    node = bench.excitation(short_plan(duration=60.0))
    bench.moving()
    provoke(bench, plant, node)
    assert node.wait() == 1, node.output()
    aborted = bench.event("aborted")
    assert reason in aborted["reason"]
    assert [event["event"] for event in bench.events()] == ["started", "aborted"]
    assert aborted["played"] < aborted["samples"]
    bench.wait_until(lambda: bench.commands and bench.commands[-1].effort[0] == 0.0, "a last command of 0 V")
    assert "Traceback" not in node.output()


def started(bench: Bench) -> bool:
    """Whether a run is on after it has been asked for, perhaps once more, as answers may get lost."""
    answer = bench.client.call("std_srvs/srv/Trigger", f"{NODE}/start")
    return answer.success or "refused: a run is on" in answer.message


def test_runs_are_started_by_service_one_after_the_other(bench: Bench) -> None:
    bench.plant(*IN_LOCKSTEP, enabled=False)
    bench.excitation(short_plan(), autostart=False, leave=False)
    refusal = bench.client.call("std_srvs/srv/Trigger", f"{NODE}/start")
    assert not refusal.success and refusal.message.startswith("refused: ")
    diagnostics = bench.client.diagnostics()
    assert bench.client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success
    for count in (1, 2):
        # The node has heard of the enable a moment after the service has answered.
        bench.wait_until(lambda: started(bench), "a start")
        bench.wait_until(lambda n=count: len(bench.events()) == 2 * n, "the end of the run")
        assert bench.events()[-1]["event"] == "finished", bench.events()[-1]["reason"]
        bench.wait_until(lambda: diagnostics["source"] == "", "the node to fall silent")


def test_a_run_is_aborted_by_service_and_none_started_beside_it(bench: Bench) -> None:
    def abort() -> Any:
        return bench.client.call("std_srvs/srv/Trigger", f"{NODE}/abort")

    bench.plant(*IN_LOCKSTEP)
    bench.excitation(short_plan(duration=60.0), autostart=False, leave=False)
    bench.wait_until(lambda: started(bench), "a start")
    assert "refused: a run is on" in bench.client.call("std_srvs/srv/Trigger", f"{NODE}/start").message
    bench.wait_until(lambda: len(bench.events()) == 1, "the run")
    answer = abort()  # of the second question, where the first answer got lost
    assert answer.success or answer.message == "refused: nothing to abort"
    bench.wait_until(lambda: len(bench.events()) == 2, "the end of the run")
    assert bench.events()[-1]["event"] == "aborted" and bench.events()[-1]["reason"] == "asked to abort"
    # An aborted run holds 0 V for a moment after it has been announced.
    bench.wait_until(lambda: abort().message == "refused: nothing to abort", "the end of the holding")


def test_another_source_is_not_disturbed(bench: Bench) -> None:
    bench.plant("-p", "watchdog:=5.0")  # a busy machine may hold the other source up
    diagnostics = bench.client.diagnostics()
    other = bench.client.source("controller", 0.5)
    bench.wait_until(lambda: diagnostics["source"] == "controller", "the other source in command")
    node = bench.excitation(short_plan())
    bench.waits_for("'controller' to stop commanding")
    node.interrupt(signal.SIGINT)
    assert node.wait() == 0, node.output()
    other.stop()
    assert not [command for command in bench.commands if command.header.frame_id == "excitation"]


def test_a_bad_plan_is_refused_before_anything_runs(launch: Any, tmp_path: Path) -> None:
    file = tmp_path / "bad.yaml"
    file.write_text("name: bad\ntravel_limit: 0.5\nsignal: {kind: triangle, amplitude: 40, frequency: 1}\n")
    node = launch("hydraulic_sysid.nodes.excitation", "--ros-args", "-p", f"plan:={file}")
    assert node.wait() == 2
    assert f"{file}: signal: triangle: amplitude = 40" in node.output()
    assert "Traceback" not in node.output()


def test_help_shows_the_parameters(launch: Any) -> None:
    node = launch("hydraulic_sysid.nodes.excitation", "--help")
    assert node.wait() == 0
    for word in ("plan", "autostart", "state_timeout", "chirp, multisine, probe, steps, triangle"):
        assert word in node.output()
