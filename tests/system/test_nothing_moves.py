"""0 mm of motion: the second source, the second plant, the stale reference, the revived process.

Each attack lasts while the plant runs; the piston stays where it is to a micrometre. The stranger on the network is in
`plant_node/test_network_boundary.py`.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hydraulic_interfaces.conversions import from_time, reference_to_message
from hydraulic_interfaces.samples import Reference

INTEGRATOR = Path(__file__).parents[1] / "plant_node" / "integrator_plant.py"  # moves with the first drive
SIMULATOR = "hydraulic_sim.nodes.simulator"
HARDWARE = f"can{os.getpid()}"  # of this process alone: other tests run at the same time
PATIENT = ("watchdog:=2.0", "rate:=125.0")  # a busy machine may let nobody speak for a while
ENOUGH = 125


@pytest.fixture
def start(launch: Any, compiled_physics: None) -> Callable[..., Any]:
    def started(target: Any, *parameters: str, options: Sequence[str] = ("--autostart",)) -> Any:
        return launch(target, *options, "--ros-args", *(word for p in parameters for word in ("-p", p)))

    return started


def enabled(client: Any) -> bool:
    return bool(client.call("std_srvs/srv/SetBool", "/actuator/enable", data=True).success)


def motion(states: Sequence[Any]) -> float:
    """Between the outermost positions [m]."""
    return float(np.ptp([state.position[0] for state in states]))


def test_a_second_source(start: Any, client: Any, wait_until: Any) -> None:
    """Under another name, and under the name of the one in command, which holds 0 V."""
    start(SIMULATOR, *PATIENT)
    states, health = client.collect("state"), client.diagnostics()
    client.source("controller", 0.0)
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enabled(client)
    wait_until(lambda: health["source"] == "controller", "the first source in command")
    client.source("stranger", 5.0)
    wait_until(lambda: health.count("other_source") > ENOUGH, "the second refused")
    client.source("controller", 5.0)
    wait_until(lambda: health.count("other_publisher") > ENOUGH or "publisher" in health["stop_reason"], "the third")
    assert {state.effort[1] for state in states} == {0.0}
    assert motion(states) < 1e-6


def test_a_second_plant(start: Any, client: Any, wait_until: Any) -> None:
    """Somebody publishes its state: who was enabled and driven stands from then on, whatever is commanded."""
    start(SIMULATOR, *PATIENT)
    states, health = client.collect("state"), client.diagnostics()
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enabled(client)
    start(SIMULATOR, *PATIENT).says("cannot configure: another process is /actuator/plant in domain")
    client.publisher("state")
    wait_until(lambda: "another plant" in health["stop_reason"], "the stop")
    client.source("hand", 5.0)
    begun = len(states)
    wait_until(lambda: len(states) > begun + ENOUGH, "a second of commands")
    assert not enabled(client)
    assert motion(states) < 1e-6


def test_a_stale_reference(start: Any, client: Any, wait_until: Any) -> None:
    states, references = client.collect("state"), client.publisher("reference")
    start(SIMULATOR, *PATIENT)
    start("hydraulic_control.nodes.controller", "autostart:=true", "gains:=npid", "age_limit:=1.0", options=())
    wait_until(lambda: states and references.get_subscription_count(), "states, and a controller that listens")
    assert client.call("std_srvs/srv/Trigger", "/actuator/emergency_stop").success

    def replay() -> None:
        now = from_time(states[-1].header.stamp)
        for stamp in (0, now - 5 * 10**9):
            references.publish(reference_to_message(Reference(stamp, 0.3, 0.0)))

    client.node.create_timer(0.05, replay)
    client.wake()
    assert client.call("std_srvs/srv/Trigger", "/actuator/reset").success
    assert enabled(client)
    begun = len(states)
    wait_until(lambda: len(states) > begun + ENOUGH, "a second enabled")
    assert motion(states) < 1e-6


def test_a_revived_process(start: Any, client: Any, wait_until: Any, monkeypatch: Any, tmp_path: Path) -> None:
    """Of hardware: killed while enabled, started again with the same command line, commanded all the time."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    real = (f"hardware:={HARDWARE}", "watchdog:=0.2")
    first = start(INTEGRATOR, *real)
    wait_until(lambda: client.state() == "active", "an active plant")
    assert enabled(client)
    first.interrupt(signal.SIGKILL)
    first.wait()
    client.source("hand", 5.0)
    states = client.collect("state")
    start(INTEGRATOR, *real)
    wait_until(lambda: len(states) > ENOUGH, "states of the next run")
    assert not enabled(client)
    begun = len(states)
    wait_until(lambda: len(states) > begun + ENOUGH, "more of them")
    assert motion(states) == 0.0
    assert client.call("std_srvs/srv/Trigger", "/actuator/reset").success
    assert enabled(client)
    wait_until(lambda: motion(states) > 1e-3, "motion, now that somebody wants it")
