"""The power of either side fails, at any step from boot to stop: the drive ends at 0 V and stays there."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import can
import pytest
from can_driver.rigs import Rig, patient_bus, rig_on

from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.virtual import faults as upset
from hydraulic_interfaces.errors import HydraulicError

# When it happens: kind, device and detail of an event in the devices, and which occurrence of it.
STEPS = {
    "identity": ("sdo read", "valve", "0x1000:0", 1),
    "setpoint 0": ("sdo write", "valve", "0x6300:1", 1),
    "boot list": ("sdo write", "valve", "0x6043:0", 1),
    "heartbeat": ("sdo write", "valve", "0x1017:0", 1),
    "mapping": ("sdo write", "valve", "0x1603:1", 1),
    "other devices": ("sdo write", "lvdt", "0x6005:1", 1),
    "read-back": ("sdo read", "valve", "0x6324:1", 1),
    "watch": ("sdo write", "valve", "0x1016:1", 1),
    "operational": ("nmt", "valve", "OPERATIONAL", 1),
    "first SYNC": ("sync", "", "1", 1),
    "disabled": ("state", "valve", "disabled", 1),
    "hold": ("state", "valve", "hold", 1),
    "active": ("state", "valve", "active", 1),
    "driving": ("sync", "", "60", 1),
    "disabling": ("state", "valve", "disabled", 2),
    "init": ("state", "valve", "init", 1),
    "pre-operational": ("nmt", "valve", "PRE-OPERATIONAL", 2),
}
LEFT = ("init", "disabled", "not ready", "fault init", "fault disabled")
RATE, LOST_AFTER_S = 100.0, 0.6


@contextmanager
def running(lost_after: float, **monitoring: Any) -> Iterator[Rig]:
    here = rig_on(replace(patient_bus(), rate=RATE), lost_after, **monitoring)
    try:
        yield here
    finally:
        here.close()


def live(here: Rig) -> str:
    """From boot to stop, with 2 V in between; the first error of the driver, after an attempt to stop."""
    problem = ""
    try:
        here.run()
        here.enable(2.0)
        while here.devices.syncs < 80 and not here.bench.problem:
            time.sleep(0.001)
        here.bench.follow(State.DISABLED)
        problem = here.bench.problem
    except HydraulicError as error:
        problem = str(error)
    if here.loop is not None:
        here.loop.ending = True
        here.loop.join()
    try:
        here.bench.stop()
    except HydraulicError as error:
        problem = problem or str(error)
    return problem


def stays_at_zero(here: Rig) -> None:
    for _ in range(20):
        assert here.devices.drive == 0.0
        here.idle(0.01)


@pytest.mark.parametrize("step", STEPS)
def test_power_of_the_valve(step: str) -> None:
    cut_device("valve", step)


@pytest.mark.parametrize("step", ["other devices", "operational", "first SYNC", "active", "driving", "disabling"])
def test_power_of_a_sensor(step: str) -> None:
    cut_device("lvdt", step)


def cut_device(node: str, step: str) -> None:
    """The power of a device fails at a step, and comes back when the driver has ended."""
    kind, name, detail, count = STEPS[step]
    with running(LOST_AFTER_S * 20.0, missed_cycles=20, state_change=1.0) as here:
        cut, happened = upset.PowerCut(node), threading.Event()
        here.devices.at(kind, name, detail, cut, count)
        here.devices.listeners.append(
            lambda e: happened.set() if (e.kind, e.node, e.detail) == ("power", node, "off") else None
        )
        problem = live(here)
        assert happened.is_set(), f"the step did not come: {problem}"
        stays_at_zero(here)
        if step not in ("init", "pre-operational") and not (node == "lvdt" and step == "disabling"):
            assert node in problem, "the diagnostic names the device"
        here.devices.clear(cut)
        stays_at_zero(here)
        assert here.devices.valve.machine.state.label in LEFT


@pytest.mark.parametrize("step", STEPS)
def test_the_plug_of_the_driver(step: str) -> None:
    """From the step on not one more frame of the driver reaches the bus."""
    kind, name, detail, count = STEPS[step]
    with running(LOST_AFTER_S, state_change=1.0) as here:
        pulled, seen = threading.Event(), [0]

        def pull(happening: Any) -> None:
            if (happening.kind, happening.node, happening.detail) == (kind, name, detail):
                seen[0] += 1
                if seen[0] == count:
                    pulled.set()

        send = here.bench.master.can.send

        def plugged(message: can.Message, timeout: float | None = None) -> None:
            if not pulled.is_set():
                send(message, timeout)

        here.bench.master.can.send = plugged  # type: ignore[method-assign]
        here.devices.listeners.append(pull)
        problem = live(here)
        assert pulled.is_set(), f"the step did not come: {problem}"
        here.idle(LOST_AFTER_S)
        assert here.devices.valve.machine.state.label != "active"
        stays_at_zero(here)
