"""The power of either side fails, at any step from boot to stop: the drive ends at 0 V and stays there."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import can
import pytest
from can_driver.rigs import Rig, patient_bus, rig_on

from hydraulic_can_driver import master
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
RATE, AT_ONCE = 100.0, 6
LOST_AFTER_S, PATIENCE_S = 0.6, 60.0


@contextmanager
def running(lost_after: float, **monitoring: Any) -> Iterator[Rig]:
    here = rig_on(replace(patient_bus(), rate=RATE), lost_after, **monitoring)
    try:
        yield here
    finally:
        here.close()


class Life(threading.Thread):
    """A bench from boot to stop, with 2 V in between; errors of the driver end it, after an attempt to stop."""

    def __init__(self, here: Rig) -> None:
        super().__init__(daemon=True)
        self.here = here
        self.problem = ""

    def run(self) -> None:
        here = self.here
        try:
            self.go_through()
        except HydraulicError as error:
            self.problem = str(error)
        if here.loop is not None:
            here.loop.ending = True
            here.loop.join()
        try:
            here.bench.stop()
        except HydraulicError as error:
            self.problem = self.problem or str(error)

    def go_through(self) -> None:
        here = self.here
        here.run()
        here.enable(2.0)
        end = time.monotonic() + 20.0
        while here.devices.syncs < 80 and not here.bench.problem and time.monotonic() < end:
            time.sleep(0.005)
        here.bench.follow(State.DISABLED)
        self.problem = here.bench.problem


def wait_until(condition: Callable[[], Any], what: str) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, f"waited {PATIENCE_S:g} s in vain for {what}"
        time.sleep(0.005)


def happened(life: Life, event: threading.Event) -> None:
    wait_until(lambda: event.is_set() or not life.is_alive(), "the step")
    assert event.is_set(), f"the step did not come: {life.problem}"


def ends_at_zero(here: Rig) -> None:
    wait_until(lambda: here.devices.drive == 0.0, "0 V at the spool")
    end = time.monotonic() + 0.2
    while time.monotonic() < end:
        assert here.devices.drive == 0.0
        time.sleep(0.005)


def cut_device(node: str, step: str) -> None:
    """The power of a device fails at a step, and comes back when the driver has ended."""
    kind, name, detail, count = STEPS[step]
    with running(LOST_AFTER_S * 20.0, missed_cycles=20, state_change=1.0) as here:
        cut, event = upset.PowerCut(node), threading.Event()
        here.devices.at(kind, name, detail, cut, count)
        here.devices.listeners.append(
            lambda e: event.set() if (e.kind, e.node, e.detail) == ("power", node, "off") else None
        )
        life = Life(here)
        life.start()
        happened(life, event)
        life.join(PATIENCE_S)
        assert not life.is_alive()
        ends_at_zero(here)
        if step not in ("init", "pre-operational") and not (node == "lvdt" and step == "disabling"):
            assert node in life.problem, "the diagnostic names the device"
        here.devices.clear(cut)
        ends_at_zero(here)
        assert here.devices.valve.machine.state.label in LEFT


def cut_driver(step: str) -> None:
    """From the step on not one more frame of the driver reaches the bus: as if its plug had been pulled."""
    kind, name, detail, count = STEPS[step]
    with running(LOST_AFTER_S, state_change=1.0) as here:
        event = threading.Event()
        seen = [0]

        def pull(happening: Any) -> None:
            if (happening.kind, happening.node, happening.detail) == (kind, name, detail):
                seen[0] += 1
                if seen[0] == count:
                    event.set()

        send = here.bench.master.can.send

        def plugged(message: can.Message, timeout: float | None = None) -> None:
            if not event.is_set():
                send(message, timeout)

        here.bench.master.can.send = plugged  # type: ignore[method-assign]
        here.devices.listeners.append(pull)
        life = Life(here)
        life.start()
        happened(life, event)
        ends_at_zero(here)
        wait_until(lambda: here.devices.valve.machine.state.label != "active", "a valve that has given up")
        if here.loop is not None:
            here.loop.ending = True
        life.join(PATIENCE_S)
        ends_at_zero(here)


CUTS = [("valve", step) for step in STEPS]
CUTS += [("lvdt", step) for step in ("other devices", "operational", "first SYNC", "active", "driving", "disabling")]
CASES: dict[tuple[str, str], Callable[[], None]] = {cut: partial(cut_device, *cut) for cut in CUTS}
CASES |= {("driver", step): partial(cut_driver, step) for step in STEPS}


@pytest.fixture(scope="module")
def outcomes() -> Iterator[dict[tuple[str, str], Future[None]]]:
    """All cases, several at once: mostly they wait for answers that do not come."""
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(AT_ONCE) as pool:
        patch.setattr(master, "_ANSWER_S", 1.2)
        yield {case: pool.submit(run) for case, run in CASES.items()}
        pool.shutdown(cancel_futures=True)


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_the_drive_ends_at_zero(case: tuple[str, str], outcomes: dict[tuple[str, str], Future[None]]) -> None:
    outcomes[case].result()
