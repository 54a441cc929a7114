"""What the plant node does when its backend does not do what it should; over real processes."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

SCRIPT = Path(__file__).parent / "integrator_plant.py"
PLANT = "/actuator/plant"
RATE = ("-p", "rate:=200.0")  # low, so that the collecting test process keeps up on a busy machine
HARDWARE = f"can{os.getpid()}"  # of this process alone: other tests run at the same time


@pytest.fixture
def journal(tmp_path: Path) -> Path:
    return tmp_path / "journal.txt"


@pytest.fixture
def start(launch: Any, journal: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    monkeypatch.setenv("XDG_STATE_HOME", str(journal.with_name("state")))

    def run(*ros: str, autostart: bool = True) -> Any:
        options = ["--autostart"] if autostart else []
        given = ("-p", f"journal:={journal}", "-p", "watchdog:=2.0", *RATE, *ros)
        return launch(SCRIPT, *options, "--ros-args", *given)

    return run


def enable(client: Any, on: bool = True) -> Any:
    return client.call("std_srvs/srv/SetBool", "/actuator/enable", data=on)


def set_parameter(client: Any, name: str, value: float) -> Any:
    from rcl_interfaces.msg import Parameter, ParameterValue

    change = Parameter(name=name, value=ParameterValue(type=3, double_value=value))
    return client.call("rcl_interfaces/srv/SetParameters", f"{PLANT}/set_parameters", parameters=[change]).results[0]


def test_a_failed_configure_leaves_a_living_node(start: Any, client: Any, journal: Path) -> None:
    process = start("-p", "trouble:=configure", autostart=False)
    assert not client.change_state("configure")
    assert client.state() == "unconfigured"
    process.says("cannot configure: no plant behind this name")
    assert journal.read_text().split() == ["configure", "cleanup"]


def test_a_failed_activate_leaves_the_plant_inactive(start: Any, client: Any, journal: Path) -> None:
    process = start("-p", "trouble:=activate", autostart=False)
    assert client.change_state("configure")
    assert not client.change_state("activate")
    assert client.state() == "inactive"
    process.says("cannot activate: the plant does not answer")
    assert journal.read_text().splitlines()[-1].startswith("deactivate")


def test_a_step_that_raises_ends_at_zero_volts_and_is_reported(
    start: Any, client: Any, wait_until: Any, journal: Path
) -> None:
    process = start("-p", "trouble:=step")
    health = client.diagnostics()
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enable(client).success
    client.source("hand", 1.0)
    wait_until(lambda: client.state() == "unconfigured", "error processing")
    wait_until(lambda: "integrator burst" in health["fault"] and health["plant level"] == "2", "the error reported")
    process.says("the plant loop ended: ArithmeticError: integrator burst")
    assert process.popen.poll() is None
    lines = journal.read_text().splitlines()
    assert "deactivate after 0.0 V" in lines and lines[-1] == "cleanup"
    # It can be brought back, but moves only after reset and enable.
    assert client.change_state("configure") and client.change_state("activate")
    assert "call reset first" in enable(client).message
    assert client.call("std_srvs/srv/Trigger", "/actuator/reset").success
    assert enable(client, False).success


def test_a_fault_of_the_plant_holds_zero_volts_until_reset(start: Any, client: Any, wait_until: Any) -> None:
    start("-p", "trouble:=fault")
    states, health = client.collect("state"), client.diagnostics()
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enable(client).success
    client.source("hand", 1.0)
    wait_until(lambda: health["fault"] == "cable break", "the fault in the diagnostics")
    stopped = len(states)
    wait_until(lambda: len(states) > stopped and states[-1].effort[1] == 0.0, "0 V")
    assert client.state() == "active"
    assert not enable(client).success
    assert client.call("std_srvs/srv/Trigger", "/actuator/reset").success
    assert enable(client).success
    wait_until(lambda: states[-1].effort[1] == 1.0, "the drive after reset and enable")


def test_enable_on_activate(start: Any, client: Any, wait_until: Any, journal: Path) -> None:
    start("-p", "enable_on_activate:=true")
    states = client.collect("state")
    client.source("hand", 1.0)
    wait_until(lambda: states and states[-1].effort[1] == 1.0, "a drive without a call of enable")
    assert "enabled True" in journal.read_text().splitlines()


def test_the_backend_sees_zero_volts_last(start: Any, client: Any, wait_until: Any, journal: Path) -> None:
    process = start("-p", "enable_on_activate:=true")
    states = client.collect("state")
    client.source("hand", 1.0)
    wait_until(lambda: states and states[-1].effort[1] == 1.0, "the commanded drive")
    process.interrupt(signal.SIGTERM)
    assert process.wait() == 0, process.output()
    lines = journal.read_text().splitlines()
    assert [line for line in lines if line.startswith("deactivate")] == ["deactivate after 0.0 V"]
    assert lines[-1] == "cleanup"


def test_a_plant_that_cannot_be_deactivated_is_reported(start: Any, client: Any, wait_until: Any) -> None:
    process = start("-p", "trouble:=deactivate")
    wait_until(lambda: client.state() == "active", "an active plant")
    assert not client.change_state("deactivate")
    process.says("the plant loop ended: BackendError: the plant does not answer")
    assert client.state() == "unconfigured"


def hanging(start: Any, client: Any, wait_until: Any, journal: Path) -> Any:
    process = start("-p", "trouble:=hang", "-p", "enable_on_activate:=true")
    wait_until(lambda: client.state() == "active", "an active plant")
    client.source("hand", 1.0)
    wait_until(lambda: "step hangs" in journal.read_text(), "a step that hangs")
    return process


def test_a_plant_that_hangs_is_neither_released_nor_configured_before_it_returns(
    start: Any, client: Any, wait_until: Any, journal: Path
) -> None:
    process = hanging(start, client, wait_until, journal)
    assert not client.change_state("deactivate")
    process.says("the plant loop hangs in its backend")
    assert not client.change_state("configure")
    process.says("cannot configure: the plant loop hangs in its backend")
    assert client.state() == "unconfigured"
    lines = journal.read_text().splitlines()
    assert lines.count("configure") == 1 and "cleanup" not in lines, "the thread is still in the plant"
    journal.with_name("go on").touch()
    wait_until(lambda: "cleanup" in journal.read_text(), "the plant released")
    after = journal.read_text().splitlines()
    after = after[after.index("step returns") :]
    assert after == ["step returns", "deactivate after 0.0 V", "cleanup"]
    assert client.change_state("configure") and client.change_state("activate")


def test_a_process_that_leaves_a_hanging_plant_says_so(start: Any, client: Any, wait_until: Any, journal: Path) -> None:
    process = hanging(start, client, wait_until, journal)
    process.interrupt(signal.SIGTERM)
    assert process.wait() == 1, process.output()
    assert "the plant may not be at 0 V" in process.output()
    assert "cleanup" not in journal.read_text().splitlines()


def test_a_process_whose_services_hang_leaves_at_zero_volts(
    start: Any, client: Any, wait_until: Any, journal: Path
) -> None:
    from rcl_interfaces.msg import Parameter, ParameterValue
    from rcl_interfaces.srv import SetParameters

    process = start("-p", "trouble:=set", "-p", "enable_on_activate:=true")
    states = client.collect("state")
    client.source("hand", 1.0)
    wait_until(lambda: states and states[-1].effort[1] == 1.0, "the commanded drive")
    setter = client.node.create_client(SetParameters, f"{PLANT}/set_parameters")
    assert setter.wait_for_service(60.0)
    change = Parameter(name="model.gain", value=ParameterValue(type=3, double_value=0.25))
    setter.call_async(SetParameters.Request(parameters=[change]))  # there will be no answer
    wait_until(lambda: "set hangs" in journal.read_text(), "a call that hangs")
    process.interrupt(signal.SIGTERM)
    assert process.wait() == 1, process.output()
    assert "leaving in the middle of a call" in process.output()
    assert journal.read_text().splitlines()[-1] == "deactivate after 0.0 V"


def test_a_value_that_the_plant_refuses_changes_nothing(
    start: Any, client: Any, wait_until: Any, journal: Path
) -> None:
    from rcl_interfaces.msg import Parameter, ParameterValue

    start()
    wait_until(lambda: client.state() == "active", "an active plant")

    def values() -> list[float]:
        names = ["model.drift", "model.gain"]
        answer = client.call("rcl_interfaces/srv/GetParameters", f"{PLANT}/get_parameters", names=names)
        return [value.double_value for value in answer.values]

    before = values()
    refused = set_parameter(client, "model.gain", 0.75)
    assert not refused.successful and refused.reason == "model.gain: the plant cannot follow"
    assert values() == before
    # Of a request that is to be taken as a whole, what was applied already is taken back.
    both = [
        Parameter(name=name, value=ParameterValue(type=3, double_value=value))
        for name, value in (("model.drift", 0.5), ("model.gain", 0.75))
    ]
    kind, name = "rcl_interfaces/srv/SetParametersAtomically", f"{PLANT}/set_parameters_atomically"
    refused = client.call(kind, name, parameters=both).result
    assert not refused.successful and "cannot follow" in refused.reason
    assert values() == before
    assert journal.read_text().splitlines()[-2:] == ["set model.drift 0.5", "set model.drift 0.0"]
    assert set_parameter(client, "model.gain", 0.25).successful and values()[1] == 0.25
    assert "set model.gain 0.75" not in journal.read_text()


def test_two_publishers_of_one_name_and_a_longer_watchdog(start: Any, client: Any, wait_until: Any) -> None:
    process = start("-p", "enable_on_activate:=true")
    states, health = client.collect("state"), client.diagnostics()
    client.source("controller", 4.0)
    wait_until(lambda: states and states[-1].effort[1] == 4.0, "the drive of the first")
    client.source("controller", -4.0)
    wait_until(lambda: health.count("other_publisher") > 100, "the second counted")
    # The level is that of the last second, in which a busy machine may let neither of them speak.
    wait_until(lambda: health["command level"] == "1", "the second told")
    assert {state.effort[1] for state in states} <= {0.0, 4.0}
    assert health["second_publisher_of"] == "controller"
    assert process.output().count("a second publisher commands as 'controller' and is refused") == 1

    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import JointState

    unheard = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    client.node.create_publisher(JointState, "/actuator/command", unheard)
    wait_until(lambda: "/test/test_client" in health["not_heard"], "a publisher that is not heard")
    process.says("commands are not heard, their QoS does not match: /test/test_client (ERROR: Best effort publisher")
    refused = set_parameter(client, "watchdog", 5.0)
    assert not refused.successful and "read when the node is configured" in refused.reason


def test_one_plant_per_name(start: Any, client: Any, wait_until: Any, journal: Path) -> None:
    """A second one is not configured; a publisher of its state that is there all the same stops the first."""
    first = start()
    states, health = client.collect("state"), client.diagnostics()
    client.source("hand", 1.0)
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enable(client).success
    wait_until(lambda: states and states[-1].effort[1] == 1.0, "the commanded drive")
    second = start()
    second.says("cannot configure: another process is /actuator/plant in domain")
    assert journal.read_text().split().count("configure") == 1, "the second has not touched its plant"
    assert states[-1].effort[1] == 1.0 and "another plant" not in first.output()
    second.end()
    impostor = client.publisher("state")
    wait_until(lambda: states[-1].effort[1] == 0.0, "0 V")
    wait_until(lambda: "another plant: /test/test_client" in health["stop_reason"], "the reason in the diagnostics")
    assert health["plant level"] == "2" and "enabled False" in journal.read_text().splitlines()
    answer = client.call("std_srvs/srv/Trigger", "/actuator/reset")
    assert not answer.success and "/test/test_client" in answer.message
    client.withdraw(impostor)
    wait_until(lambda: client.call("std_srvs/srv/Trigger", "/actuator/reset").success, "a reset once it has left")
    assert first.output().count("another plant: /test/test_client publishes") <= 2, "a warning and the stop itself"
    assert enable(client).success


def test_a_real_actuator_has_a_short_watchdog(start: Any, client: Any) -> None:
    process = start("-p", f"hardware:={HARDWARE}", autostart=False)
    assert not client.change_state("configure")
    process.says(
        f"watchdog is 2 s: an actuator on {HARDWARE} must not be driven for longer without a command than 0.2 s"
    )
    assert set_parameter(client, "watchdog", 0.2).successful
    assert client.change_state("configure")


def test_a_real_actuator_remembers_a_stop_and_an_end_that_nobody_ordered(
    start: Any, client: Any, wait_until: Any
) -> None:
    real = ("-p", f"hardware:={HARDWARE}", "-p", "watchdog:=0.2")
    process = start(*real, "-p", "enable_on_activate:=true", autostart=False)
    assert not client.change_state("configure")
    process.says(f"enable_on_activate: an actuator on {HARDWARE} is enabled by the service alone")
    process.end()

    def again(last: Any, number: int) -> Any:
        last.interrupt(number)
        last.wait()
        process = start(*real)
        wait_until(lambda: client.state() == "active", "an active plant")
        return process

    process = start(*real)
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enable(client).success
    process = again(process, signal.SIGKILL)
    refusal = enable(client)
    assert not refusal.success and "ended without a word" in refusal.message and "reset" in refusal.message
    assert client.call("std_srvs/srv/Trigger", "/actuator/reset").success
    assert enable(client).success
    assert client.call("std_srvs/srv/Trigger", "/actuator/emergency_stop").success
    process = again(process, signal.SIGTERM)
    assert "from before this start: emergency stop" in enable(client).message


def test_a_misspelt_parameter_is_named(start: Any) -> None:
    start("-p", "wachdog:=1.0").says("no parameter has the name 'wachdog'")


def test_limit_switches_follow_the_piston(start: Any, client: Any, wait_until: Any) -> None:
    start("-p", "enable_on_activate:=true", "-p", "model.gain:=1.0")
    extended, retracted = client.collect("limit_extended"), client.collect("limit_retracted")
    source = client.source("hand", 10.0)
    wait_until(lambda: extended and extended[-1].data, "the extended limit switch")
    source.drive = -10.0
    wait_until(lambda: retracted and retracted[-1].data, "the retracted limit switch")
    wait_until(lambda: not extended[-1].data, "an open extended limit switch")


def test_parameters_known_after_configure(start: Any, client: Any, wait_until: Any, journal: Path) -> None:
    start("-p", "model.gain:=0.5")
    wait_until(lambda: client.state() == "active", "an active plant")
    assert "set model.gain 0.5" in journal.read_text().splitlines()
    assert set_parameter(client, "model.gain", 0.25).successful
    wait_until(lambda: "set model.gain 0.25" in journal.read_text(), "the value in the backend")
    refused = set_parameter(client, "model.gain", 2.0)
    assert not refused.successful
    answer = client.call("rcl_interfaces/srv/DescribeParameters", f"{PLANT}/describe_parameters", names=["model.gain"])
    assert answer.descriptors[0].description == "velocity per drive [m/s/V]"
    for transition in ("deactivate", "cleanup", "configure"):
        assert client.change_state(transition)


@pytest.mark.parametrize("bad", ["rate:=-5.0", "rate:=fast", "watchdog:=.nan", "realtime_priority:=200"])
def test_a_bad_parameter_is_one_clear_line(launch: Any, bad: str) -> None:
    process = launch(SCRIPT, "--ros-args", "-p", bad)
    assert process.wait() == 2
    assert "Traceback" not in process.output()
    assert bad.partition(":")[0] in process.output()


def test_unknown_options_are_named(launch: Any) -> None:
    process = launch(SCRIPT, "--autosart")
    assert process.wait() == 2
    assert "--autosart" in process.output()


def test_clock_of_its_own(start: Any, client: Any, wait_until: Any) -> None:
    import rclpy
    from rosgraph_msgs.msg import Clock

    from hydraulic_interfaces.conversions import from_time

    client.node.set_parameters([rclpy.Parameter("use_sim_time", value=True)])
    ticks: list[Any] = []
    client.node.create_subscription(Clock, "/clock", ticks.append, 10)
    states = client.collect("state")
    start("-p", "publish_clock:=true", "-p", "real_time_factor:=0.5", "-p", "enable_on_activate:=true")
    client.source("hand", 1.0)
    wait_until(lambda: states and states[-1].effort[1] == 1.0, "a source on simulated time being obeyed")
    wait_until(lambda: ticks, "a tick of the clock")
    assert abs(from_time(ticks[-1].clock) - from_time(states[-1].header.stamp)) < 1e9


def test_a_factor_without_a_clock_is_refused(start: Any, client: Any) -> None:
    process = start("-p", "real_time_factor:=2.0", autostart=False)
    assert not client.change_state("configure")
    process.says("real_time_factor is 2")


def test_a_plant_follows_no_other_clock(start: Any, client: Any) -> None:
    process = start("-p", "use_sim_time:=true", autostart=False)
    assert not client.change_state("configure")
    process.says("use_sim_time is true")


def test_the_clock_does_not_follow_itself(start: Any, client: Any, wait_until: Any) -> None:
    states = client.collect("state")
    start("-p", "use_sim_time:=true", "-p", "publish_clock:=true")
    wait_until(lambda: len(states) > 10, "states of a plant that was launched on simulated time")
    subscribers = client.node.get_subscriptions_info_by_topic("/clock")
    assert "plant" not in [info.node_name for info in subscribers]


def test_what_the_plant_is_reaches_whoever_comes_later(start: Any, client: Any, wait_until: Any) -> None:
    start()
    wait_until(lambda: client.state() == "active", "an active plant")
    told = client.collect("description", depth=1)
    wait_until(lambda: told, "the latched description")
    assert json.loads(told[-1].data) == {"hardware": "integrator", "gain": 0.05}
