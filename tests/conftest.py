"""Fixtures of all tests: a private ROS domain, real processes, and a client that talks to them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 150.0
# Fast DDS drops an answer when it has not yet found the asking client after 100 ms, which a loaded machine exceeds.
ASK_AGAIN_S = 3.0

# Several tests run at once, and matrices are small: threads of the linear algebra would only spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Started with `nohup … &`, this process and with it all that it starts would ignore SIGINT, which tests send.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _wait_until(condition: Callable[[], Any], what: str, patience: float = PATIENCE_S) -> Any:
    """The first true value of `condition`; fails the test with `what` if none comes in time."""
    deadline = time.monotonic() + patience
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline:
            pytest.fail(f"waited {patience:g} s in vain for {what}")
        time.sleep(0.01)


class Process:
    """A child in a process group of its own; everything it prints goes to one file."""

    def __init__(self, command: list[str], log: Path, cwd: Path | None = None) -> None:
        self.command = command
        self.log = log
        with log.open("wb") as sink:
            self.popen = subprocess.Popen(
                command,
                stdout=sink,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                cwd=cwd,
            )

    def output(self) -> str:
        """What it has printed so far."""
        return self.log.read_text(errors="replace")

    def says(self, text: str, patience: float = PATIENCE_S) -> None:
        """Wait until it has printed `text`."""
        _wait_until(
            lambda: text in self.output() or self.popen.poll() is not None,
            f"{text!r} from {self.command}",
            patience,
        )
        assert text in self.output(), self.output()

    def interrupt(self, number: int = signal.SIGINT) -> None:
        """Send a signal to its group."""
        os.killpg(self.popen.pid, number)

    def wait(self, patience: float = PATIENCE_S) -> int:
        """Exit code, once it has ended by itself."""
        try:
            return self.popen.wait(patience)
        except subprocess.TimeoutExpired:
            pytest.fail(f"{self.command} did not end within {patience:g} s:\n{self.output()}")

    def end(self) -> None:
        """Kill the whole group, and wait."""
        if self.popen.poll() is None:
            self.interrupt()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.popen.wait(5.0)
        # The leader may be gone and have left children behind.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.popen.pid, signal.SIGKILL)
        self.popen.wait()


LONGEST = (
    "workbench/page/test_loop.py",
    "system/test_demo.py",
    "system/test_demo_can.py",
    "system/test_paper.py",
    "hidden_effects/test_proposed_effect.py",
    "sysid/test_verbs_diagnose.py",
    "sysid/test_next_experiment.py",
    "sysid/test_measured_studies.py",
    "workbench/page/test_live.py",
    "workbench/test_workbench_node.py",
    "bringup/test_paper.py",
    "hidden_effects/test_benches.py",
    "sim/test_user_effects.py",
    "sysid/test_campaign.py",
    "sim/test_exchange.py",
    "sysid/test_memory.py",
    "sysid/test_explanations.py",
    "hidden_effects/test_diagnosis.py",
    "sysid/test_diagnose.py",
    "control/test_nodes.py",
    "sysid/test_locate.py",
    "sysid/test_locate_parts.py",
    "contract/test_plant_contract.py",
    "plant_node/test_plant_node.py",
    "sysid/test_excitation_node.py",
    "sysid/test_recorder_node.py",
    "workbench/page/test_without_plant.py",
    "sim/test_simulator_node.py",
    "system/test_two_actuators.py",
    "sysid/test_calibrate.py",
    "sysid/test_estimator_node.py",
    "sim/test_user_effect_example.py",
    "hidden_effects/test_emps.py",
    "system/test_nothing_moves.py",
    "sysid/test_report.py",
    "workbench/test_server.py",
    "can_driver/test_node.py",
    "sim/test_effect_battery.py",
    "control/test_tuning.py",
    "sysid/test_monitoring.py",
    "sysid/test_check.py",
    "sysid/test_condition_monitor.py",
    "bringup/test_bench_entry.py",
    "sysid/test_starts_of_segments.py",
    "sysid/test_excitation_design.py",
    "bringup/test_packaging.py",
    "can_driver/test_power_cuts.py",
    "sysid/test_small_effects.py",
    "sysid/test_bandwidth_node.py",
    "hidden_effects/test_family.py",
    "plant_node/test_network_boundary.py",
)
"""Files whose tests come first, so that no processor waits for another at the end."""

ONE_BY_ONE = {
    "contract/test_plant_contract.py",
    "control/test_nodes.py",
    "hidden_effects/test_diagnosis.py",
    "plant_node/test_plant_node.py",
    "sysid/test_diagnose.py",
    "sysid/test_excitation_node.py",
    "sysid/test_explanations.py",
    "sysid/test_locate.py",
    "sysid/test_memory.py",
    "sysid/test_recorder_node.py",
}
"""Files whose tests share nothing that takes long to make: each goes to the processor that is free."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest."""
    rank = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0].removeprefix("tests/"), len(rank)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """The tests of a file go to one worker, but for those that are independent of each other."""
    from xdist.scheduler import LoadScopeScheduling

    class Scheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.partition("::")[0]
            return nodeid if file.removeprefix("tests/") in ONE_BY_ONE else file

    return Scheduling(config, log)


@pytest.fixture(name="wait_until", scope="session")
def wait_until_fixture() -> Callable[..., Any]:
    """`wait_until(condition, what, patience)`: the first true value of `condition`, or a failed test."""
    return _wait_until


@pytest.fixture(autouse=True)
def ordinary_scheduling() -> Iterator[None]:
    """A test that leaves real-time scheduling behind fails: all that later tests start would inherit it."""
    if not hasattr(os, "sched_getscheduler"):
        yield
        return
    before = os.sched_getscheduler(0)
    yield
    assert os.sched_getscheduler(0) == before, "this test has left its process real-time scheduling"


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain of this test's own, on this machine only, in the environment of it and of its children."""
    from hydraulic_node_utils.nodes import middleware

    domain_coordinator = pytest.importorskip("domain_coordinator")
    with domain_coordinator.domain_id() as number:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        for name, value in middleware.VARIABLES.items():
            monkeypatch.setenv(name, value)
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path for path in sys.path if path))
        monkeypatch.setenv("PYTHONUNBUFFERED", "1")
        yield number


@pytest.fixture
def launch(ros_domain: int, tmp_path: Path) -> Iterator[Callable[..., Process]]:
    """Starts processes in the private domain: `launch("hydraulic_sim.nodes.simulator", "--autostart")`.

    The first argument is a module, or the path of a script. All process groups are killed at the end.
    """
    started: list[Process] = []

    def start(target: str | Path, *arguments: str) -> Process:
        program = [str(target)] if str(target).endswith(".py") else ["-m", str(target)]
        log = tmp_path / f"process_{len(started)}.log"
        started.append(Process([sys.executable, *program, *arguments], log))
        return started[-1]

    yield start
    for process in reversed(started):
        process.end()


@pytest.fixture(scope="session")
def compiled_physics() -> None:
    """The plant's kernels in the cache on disk, so that no node has to compile them while a test waits for it."""
    from hydraulic_sim.live import LivePlant
    from hydraulic_sim.model_file import load_model
    from hydraulic_sim.plant import Plant

    LivePlant(Plant(load_model("sample_bench"))).step(0.0, 1e-3)


class Client:
    """A node in the test's process: subscriptions that collect, publishers, service and parameter calls."""

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self.node = rclpy.create_node("test_client", namespace="/test", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._clients: dict[str, Any] = {}
        self._running = True
        self._thread.start()

    def _spin(self) -> None:
        while self._running:
            self._executor.spin_once(timeout_sec=0.1)

    def wake(self) -> None:
        """Let the spinning thread see what was created."""
        self._executor.wake()

    def collect(self, name: str, depth: int = 5000, namespace: str = "/actuator") -> list[Any]:
        """A list that grows by every message on a topic of the contract."""
        from hydraulic_interfaces.contract import find_topic, topic
        from hydraulic_interfaces.conversions import interface_class
        from hydraulic_interfaces.qos import profile

        heard: list[Any] = []
        kind = interface_class(find_topic(name).type)
        self.node.create_subscription(kind, topic(name, namespace), heard.append, profile(name, depth))
        self.wake()
        return heard

    def publisher(self, name: str, namespace: str = "/actuator") -> Any:
        """A publisher on a topic of the contract."""
        from hydraulic_interfaces.contract import find_topic, topic
        from hydraulic_interfaces.conversions import interface_class
        from hydraulic_interfaces.qos import profile

        kind = interface_class(find_topic(name).type)
        return self.node.create_publisher(kind, topic(name, namespace), profile(name))

    def withdraw(self, publisher: Any) -> None:
        """Destroy a publisher."""
        self.within(self.node.destroy_publisher, publisher)

    def within(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call what ends a timer or publisher in the thread that waits for it, which would fall over it otherwise."""
        task = self._executor.create_task(function, *arguments)
        self.wake()
        _wait_until(task.done, f"{function} by the client's own thread")

    def call(self, kind: str, name: str, patience: float = PATIENCE_S, **fields: Any) -> Any:
        """Response of a service of type `kind` ("std_srvs/srv/Trigger") at the full name `name`.

        Asked again when no answer comes: the first answer counts, and a second call must do no harm.
        """
        from hydraulic_interfaces.conversions import interface_class

        service = interface_class(kind)
        if name not in self._clients:
            self._clients[name] = self.node.create_client(service, name)
            self.wake()
        client = self._clients[name]
        assert client.wait_for_service(timeout_sec=patience), f"no service {name}"
        futures: list[Any] = []
        asked = [0.0]

        def answer() -> Any:
            if time.monotonic() - asked[0] > ASK_AGAIN_S:
                asked[0] = time.monotonic()
                futures.append(client.call_async(service.Request(**fields)))
                self.wake()
            return next((future.result() for future in futures if future.done()), None)

        return _wait_until(answer, f"an answer from {name}", patience)

    def change_state(self, label: str, node: str = "/actuator/plant", patience: float = 100.0) -> bool:
        """Whether the managed node did the transition ("configure", "activate", …)."""
        from lifecycle_msgs.msg import Transition

        goal = {"configure": "inactive", "activate": "active", "deactivate": "inactive", "cleanup": "unconfigured"}
        before = self.state(node)
        done = self.call(
            "lifecycle_msgs/srv/ChangeState",
            f"{node}/change_state",
            patience,
            transition=Transition(id=getattr(Transition, f"TRANSITION_{label.upper()}")),
        ).success
        # Where the first answer was lost, the second says that the transition is no longer possible.
        return bool(done) or before != self.state(node) == goal[label]

    def state(self, node: str = "/actuator/plant") -> str:
        """Lifecycle state of a managed node by its label."""
        return str(self.call("lifecycle_msgs/srv/GetState", f"{node}/get_state").current_state.label)

    def source(self, name: str, drive: float, period: float = 0.01) -> Source:
        """A source that commands `drive` [V] from now on, until it is stopped."""
        return Source(self, name, drive, period)

    def diagnostics(self) -> Diagnostics:
        """What the plant says about itself from now on."""
        return Diagnostics(self.collect("diagnostics"))

    def close(self) -> None:
        """Take the node down."""
        import rclpy

        self._running = False
        self._executor.wake()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


class Diagnostics:
    """The newest diagnostics of the plant."""

    def __init__(self, heard: list[Any]) -> None:
        self._heard = heard

    def values(self) -> dict[str, str]:
        """All values by key, and per part ("command", "timing", "plant") its message and "<part> level"."""
        found: dict[str, str] = {}
        for message in self._heard[-20:]:
            for status in message.status:
                if status.name.startswith("/actuator/plant: "):
                    part = status.name.partition(": ")[2]
                    found |= {entry.key: entry.value for entry in status.values}
                    found |= {part: status.message, f"{part} level": str(ord(status.level))}
        return found

    def __getitem__(self, key: str) -> str:
        return self.values().get(key, "")

    def count(self, key: str) -> int:
        """A counter; 0 before anything was heard."""
        return int(self[key] or 0)


class Source:
    """Commands a plant like any other source, over the topic; `drive` and `age` [s] may be changed."""

    def __init__(self, client: Client, name: str, drive: float, period: float) -> None:
        self._client, self._name, self.drive, self.age = client, name, drive, 0.0
        self._publisher = client.publisher("command")
        self._timer = client.node.create_timer(period, self._publish)
        client.wake()

    def _publish(self) -> None:
        from hydraulic_interfaces.conversions import command_to_message
        from hydraulic_interfaces.samples import Command

        now = self._client.node.get_clock().now().nanoseconds
        self._publisher.publish(command_to_message(Command(now - round(self.age * 1e9), self._name, self.drive)))

    def stop(self) -> None:
        """Fall silent."""
        self._client.within(self._timer.cancel)


@pytest.fixture
def client(ros_domain: int) -> Iterator[Client]:
    """A ROS client in the private domain."""
    one = Client()
    yield one
    one.close()
