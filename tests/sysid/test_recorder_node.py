"""The recorder as a process, fed by a publisher in another one."""

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from mcap.reader import make_reader  # noqa: E402
from rosbags.rosbag2 import Reader  # noqa: E402

from hydraulic_interfaces.contract import absolute, find_topic, topic  # noqa: E402
from hydraulic_interfaces.conversions import StateEncoder, interface_class  # noqa: E402
from hydraulic_interfaces.qos import profile  # noqa: E402
from hydraulic_interfaces.samples import PlantSample  # noqa: E402
from hydraulic_sysid.data.bag import recover  # noqa: E402
from hydraulic_sysid.data.bag.types import typestore  # noqa: E402

NODE = "hydraulic_sysid.nodes.recorder"
SOURCE = Path(__file__).parent / "recorder_source.py"
STREAMS = ("state", "pressure_a", "pressure_b", "pressure_supply", "command")
FIRST_STAMP = 10**18


def options(**parameters: object) -> list[str]:
    pairs = [f"{name}:={json.dumps(value)}" for name, value in parameters.items()]
    return ["--ros-args", *(part for pair in pairs for part in ("-p", pair))]


def read(bag: Path) -> dict[str, list[Any]]:
    """Messages of a bag by topic, through rosbags."""
    heard: dict[str, list[Any]] = {}
    with Reader(bag) as reader:
        for connection, _, raw in reader.messages():
            message = typestore().deserialize_cdr(raw, connection.msgtype)
            heard.setdefault(connection.topic, []).append(message)
    return heard


def stamp(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


@pytest.fixture
def statuses(client: Any) -> list[dict[str, Any]]:
    """What the recorder tells on its status topic."""
    from std_msgs.msg import String

    heard: list[dict[str, Any]] = []
    name = absolute("recorder/status")
    client.node.create_subscription(
        String, name, lambda message: heard.append(json.loads(message.data)), profile("latched", 100)
    )
    return heard


@pytest.fixture
def status_of(statuses: list[dict[str, Any]], wait_until: Any) -> Callable[[str], dict[str, Any]]:
    """The last status of a state, once there is one."""

    def find(state: str) -> dict[str, Any]:
        def found() -> list[dict[str, Any]]:
            return [status for status in statuses if status["state"] == state]

        return dict(wait_until(found, f"a status {state!r}")[-1])

    return find


def test_it_listens_to_commands_once_the_plant_is_heard(
    launch: Callable[..., Any], client: Any, status_of: Any, wait_until: Any, tmp_path: Path
) -> None:
    """Whoever waits for a listener to commands may then begin: the first state is not lost."""
    launch(NODE, *options(output=str(tmp_path / "bag")))
    assert status_of("recording")
    node, state = client.node, find_topic("state")
    commands = node.create_publisher(interface_class(state.type), topic("command"), profile("command"))
    states = node.create_publisher(interface_class(state.type), topic("state"), profile("state"))
    wait_until(lambda: states.get_subscription_count() == 1, "the recorder on the states")
    assert commands.get_subscription_count() == 0
    encode = StateEncoder()
    states.publish(encode(PlantSample(FIRST_STAMP, 0.0, 0.0, 0.0, 0.0)))
    wait_until(lambda: commands.get_subscription_count() == 1, "the recorder on the commands", 8.0)


def test_every_message_of_an_experiment(
    launch: Callable[..., Any], status_of: Any, statuses: list[dict[str, Any]], tmp_path: Path
) -> None:
    bag = tmp_path / "new" / "bag"
    recorder = launch(
        NODE,
        *options(output=str(bag), description="ü", stop_on_experiment_end=True, exit_when_done=True),
    )
    assert status_of("recording")["output"] == str(bag)
    source = launch(SOURCE, "500", "0.001")
    assert recorder.wait() == 0, recorder.output()
    assert "sent" in source.output()

    closed = status_of("closed")
    assert closed["reason"] == "experiment finished" and closed["missing"] == {}
    assert {name: closed["messages"][topic(name)] for name in STREAMS} == dict.fromkeys(STREAMS, 500)
    connected = [status["publishers"] for status in statuses if status["state"] == "recording"]
    assert any(publishers.get(topic("state")) == 1 for publishers in connected)

    heard = read(bag)
    for name in STREAMS:
        assert [stamp(m) for m in heard[topic(name)]] == [FIRST_STAMP + k * 10**6 for k in range(500)]
    assert [m.position[0] for m in heard[topic("state")]] == [float(k) for k in range(500)]
    assert [m.fluid_pressure for m in heard[topic("pressure_b")]] == [k + 1.0 for k in range(500)]
    assert [json.loads(m.data)["event"] for m in heard[topic("experiment")]] == ["started", "finished"]
    assert topic("diagnostics") in heard
    with Reader(bag) as reader:
        custom = reader.storage.metadata.custom
        assert custom["description"] == "ü"
        assert json.loads(custom["experiment"])["plan"] == {"é": [1, 2]}
        types = {c.topic: c.msgtype for c in reader.connections}
        hashes = {c.topic: c.digest for c in reader.connections}
    assert all(types[topic(name)] == find_topic(name).type for name in STREAMS)
    assert all(value.startswith("RIHS01_") for value in hashes.values())
    with next(bag.glob("*.mcap")).open("rb") as stream:
        rows = [m for _, c, m in make_reader(stream).iter_messages() if c.topic == topic("state")]
    assert [m.publish_time for m in rows] == [FIRST_STAMP + k * 10**6 for k in range(500)]
    assert [b.sequence - a.sequence for a, b in zip(rows, rows[1:], strict=False)] == [1] * 499


def test_killed_and_recovered(launch: Callable[..., Any], status_of: Any, wait_until: Any, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    recorder = launch(NODE, *options(output=str(bag)))
    status_of("recording")
    launch(SOURCE, "0", "0.001")
    wait_until(lambda: next(bag.glob("*.mcap")).stat().st_size > 100_000, "some data on the disk")
    recorder.interrupt(signal.SIGKILL)
    assert recorder.wait() == -signal.SIGKILL
    assert not (bag / "metadata.yaml").exists()

    result = recover(bag)
    heard = read(bag)
    for name in STREAMS:
        stamps = [stamp(m) for m in heard[topic(name)]]
        assert stamps == [FIRST_STAMP + k * 10**6 for k in range(len(stamps))]
        assert result.summary.messages[topic(name)] == len(stamps) > 100
    with Reader(bag) as reader:
        assert json.loads(reader.storage.metadata.custom["experiment"])["event"] == "started"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_finishes_the_bag_without_any_plant(
    launch: Callable[..., Any], status_of: Any, tmp_path: Path, number: int
) -> None:
    bag = tmp_path / "bag"
    recorder = launch(NODE, *options(output=str(bag)))
    status_of("recording")
    recorder.interrupt(number)
    assert recorder.wait() == 0, recorder.output()
    assert status_of("closed")["reason"] == "signal"
    assert recover(bag).whole
    read(bag)


def test_it_stays_after_closing_and_tells_how_it_is(
    launch: Callable[..., Any], client: Any, status_of: Any, wait_until: Any, tmp_path: Path
) -> None:
    heard = client.collect("diagnostics")
    recorder = launch(NODE, *options(output=str(tmp_path / "bag"), max_duration=0.5))
    assert status_of("closed")["reason"] == "max_duration"
    assert recorder.popen.poll() is None

    def closed() -> list[Any]:
        return [
            s for m in heard for s in m.status if (s.name, s.message) == ("/actuator/recorder: recording", "closed")
        ]

    status = wait_until(closed, "diagnostics after closing")[-1]
    values = {entry.key: entry.value for entry in status.values}
    assert values["queued"] == "0" and int(values["received_bytes"]) > 0
    recorder.interrupt(signal.SIGTERM)
    assert recorder.wait() == 0


def test_busy_processes_do_not_keep_it_from_taking_messages_in(
    launch: Callable[..., Any], status_of: Any, tmp_path: Path
) -> None:
    """Every thread that takes them in goes before ordinary processes, where the system permits that."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except OSError:
        pytest.skip("this user may not have real-time scheduling")
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    recorder = launch(NODE, *options(output=str(tmp_path / "bag")))
    status_of("recording")
    threads = [int(name) for name in os.listdir(f"/proc/{recorder.popen.pid}/task")]
    assert len(threads) > 5
    assert {os.sched_getscheduler(thread) for thread in threads} == {os.SCHED_FIFO}


def test_an_existing_folder_is_refused(launch: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    recorder = launch(NODE, *options(output=str(tmp_path / "bag")))
    assert recorder.wait() == 2
    assert f"{tmp_path / 'bag'}: exists; nothing is overwritten" in recorder.output()
    assert "Traceback" not in recorder.output()
    assert list((tmp_path / "bag").iterdir()) == []


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({}, "no folder given"),
        ({"output": "b", "max_duration": -1.0}, "max_duration"),
        ({"output": 5}, "output"),
    ],
)
def test_bad_parameters(launch: Callable[..., Any], parameters: dict[str, object], text: str) -> None:
    recorder = launch(NODE, *options(**parameters))
    assert recorder.wait() == 2
    assert text in recorder.output() and "Traceback" not in recorder.output()


def test_a_full_disk_ends_it(launch: Callable[..., Any], status_of: Any, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    script = tmp_path / "limited.py"
    script.write_text(
        "import resource, sys\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))\n"
        f"from {NODE} import main\n"
        "sys.exit(main())\n"
    )
    recorder = launch(script, *options(output=str(bag)))
    status_of("recording")
    launch(SOURCE, "0", "0.001")
    assert recorder.wait() == 1
    assert "cannot write" in recorder.output() and f"recover {bag}" in recorder.output()
    assert "File too large" in status_of("failed")["error"]
    assert sum(recover(bag).summary.messages.values()) > 0
