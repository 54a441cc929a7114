"""Every fault of the bench, provoked in virtual devices: 0 V, disabled, named, latched until `reset`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.errors import DeviceError
from hydraulic_can_driver.faults import BusFault
from hydraulic_can_driver.virtual import faults as upset


@dataclass(frozen=True)
class Case:
    """An upset, the fault it must lead to, and words of the diagnostic.

    `lasts`: a reset is refused while it does. `after`: what releases it once it is over: reset, activate, configure.
    """

    upset: Any
    fault: BusFault
    words: str
    lasts: bool = True
    after: str = "reset"
    settings: dict[str, Any] = field(default_factory=dict)


SOON = {"missed_cycles": 20}
CASES = {
    "heartbeat lost": Case(
        upset.HeartbeatStop("lvdt"), BusFault.HEARTBEAT, "heartbeat: lvdt", settings={"heartbeats": 10}
    ),
    "EMCY of a sensor": Case(upset.Emergency("lvdt", 0x5000), BusFault.EMERGENCY, "lvdt: EMCY 0x5000"),
    "EMCY of the valve": Case(upset.Emergency("valve", 0x3412, 4), BusFault.EMERGENCY, "valve: EMCY 0x3412"),
    "status fault": Case(upset.StatusFault("valve"), BusFault.EMERGENCY, "valve: EMCY 0x3412"),
    "missing frame": Case(
        upset.MissingPdo("pressure_b"), BusFault.FRAMES, "pressure_b", after="activate", settings=SOON
    ),
    "late frame": Case(upset.LatePdo("lvdt", 0.05), BusFault.FRAMES, "lvdt", after="activate", settings=SOON),
    "wrong length": Case(upset.PdoLength("lvdt", 3), BusFault.LENGTH, "3 bytes; mapped are 7", after="configure"),
    "jump": Case(upset.PositionJump("lvdt", 0.3), BusFault.POSITION, "jumps by 0.3", lasts=False),
    "out of stroke": Case(upset.PositionStuck("lvdt", 0.9), BusFault.POSITION, "out of the stroke"),
    "frozen": Case(upset.PositionFrozen("lvdt"), BusFault.POSITION, "frozen", lasts=False),
    "cable of a transducer": Case(upset.CableBreak("pressure_a"), BusFault.SENSOR, "pressure_a is not valid"),
    "cable of the LVDT": Case(upset.CableBreak("lvdt"), BusFault.EMERGENCY, "lvdt: EMCY"),
    "cable of the spool": Case(upset.CableBreak("valve"), BusFault.EMERGENCY, "valve: EMCY"),
    "power cut of a sensor": Case(upset.PowerCut("lvdt"), BusFault.FRAMES, "lvdt", after="configure", settings=SOON),
    "power cut of the valve": Case(upset.PowerCut("valve"), BusFault.FRAMES, "valve", after="configure", settings=SOON),
    "connector out": Case(upset.Unplugged("lvdt"), BusFault.FRAMES, "lvdt", after="activate", settings=SOON),
    "bus-off": Case(upset.BusOff(), BusFault.BUS, "bus-off", lasts=False),
}


@pytest.mark.parametrize("name", CASES)
def test_fault(name: str, rig: Callable[..., Any], wait_until: Any) -> None:
    case = CASES[name]
    here = rig(**case.settings)
    loop = here.run()
    here.enable(2.0)
    wait_until(lambda: here.devices.drive == pytest.approx(2.0, abs=1e-3), "2 V at the spool")
    wait_until(lambda: loop.samples[-1].position > 1e-3, "a piston that moves")
    here.devices.inject(case.upset)
    wait_until(lambda: case.fault in here.bench.faults, f"the fault {case.fault.name}")
    assert case.words in here.bench.problem
    with pytest.raises(DeviceError):
        here.bench.follow(State.ACTIVE)
    wait_until(lambda: here.devices.drive == 0.0, "0 V at the spool")
    wait_until(lambda: here.bench.machine.control == 1, "a control word that asks for DISABLED")
    latched = len(loop.samples)
    if case.lasts:
        with pytest.raises(DeviceError):
            here.bench.reset()
    assert here.devices.drive == 0.0 and {sample.drive for sample in loop.samples[latched:]} <= {0.0}
    if name == "connector out":
        wait_until(lambda: here.devices.valve.machine.state.label == "disabled", "a valve that is disabled")
    here.devices.clear(case.upset)
    loop.drive = 0.0
    if case.after == "reset":
        wait_until(lambda: accepted(here.bench), "a reset that is accepted")
    else:
        if case.after == "configure":
            kinds = (BusFault.RESTART, BusFault.LENGTH)
            wait_until(lambda: any(kind in here.bench.faults for kind in kinds), "a fault that stays")
            with pytest.raises(DeviceError, match="configure"):
                here.bench.reset()
        loop = here.again(boot=case.after == "configure")
    assert here.bench.problem == "" and here.devices.drive == 0.0
    here.enable(1.0)
    wait_until(lambda: here.devices.drive == pytest.approx(1.0, abs=1e-3), "1 V at the spool after the reset")


@pytest.mark.parametrize("left", ["active", "disabled", "init"])
def test_a_driver_that_was_killed_leaves_a_valve_that_another_one_gets_going(
    left: str, rig: Callable[..., Any], wait_until: Any
) -> None:
    here = rig(lost_after=0.5)
    here.run()
    if left == "active":
        here.enable(2.0)
        wait_until(lambda: here.devices.drive == pytest.approx(2.0, abs=1e-3), "2 V at the spool")
    valve = here.devices.valve
    kill(here, control=0 if left == "init" else None)
    here.idle(0.6)
    assert "fault" in valve.machine.state.label and here.devices.drive == 0.0
    assert (valve.machine.state.label == "fault init") == (left == "init")
    drives: list[float] = []
    here.devices.listeners.append(lambda event: drives.append(here.devices.drive))
    here.bench = here.driver()
    here.run()
    assert valve.machine.state.label == "disabled" and not here.bench.problem
    assert "reset at the start" in " ".join(here.bench.faults.log)
    assert set(drives) == {0.0}
    here.enable(1.0)
    wait_until(lambda: here.devices.drive == pytest.approx(1.0, abs=1e-3), "1 V at the spool")


def kill(here: Any, control: int | None) -> None:
    """Nothing more from the driver, from one moment to the next; before it `control` as the last control word."""
    here.loop.ending = True
    here.loop.join()
    here.loop = None
    if control is not None:
        here.bench.machine.fail("test")
        here.bench.machine.control = control
        here.bench.cycle(here.bench.beat.next_sync(), 0.0)
        here.bench.cycle(here.bench.beat.next_sync(), 0.0)
    here.bench.master.close()


def test_the_connector_of_the_valve(rig: Callable[..., Any], wait_until: Any) -> None:
    """Nobody can tell it to stop: it does so by itself, and stays so when it is plugged in again."""
    here = rig(lost_after=0.5, missed_cycles=20)
    here.run()
    here.enable(2.0)
    wait_until(lambda: here.devices.drive == pytest.approx(2.0, abs=1e-3), "2 V at the spool")
    out, valve = upset.Unplugged("valve"), here.devices.valve
    here.devices.inject(out)
    wait_until(lambda: here.devices.drive == 0.0 and valve.machine.faulty, "a valve that gives up")
    wait_until(lambda: "valve" in here.bench.problem, "the diagnostic")
    here.devices.clear(out)
    wait_until(lambda: valve.machine.state.label == "fault disabled", "a valve that is disabled")
    assert here.devices.drive == 0.0
    here.again(boot=False)
    assert valve.machine.state.label == "disabled" and here.devices.drive == 0.0


def test_a_fault_that_lasts_is_told_by_the_start(rig: Callable[..., Any], wait_until: Any) -> None:
    here = rig(state_change=0.5)
    upset_valve = upset.StatusFault("valve")
    here.devices.inject(upset_valve)
    here.bench.boot()
    with pytest.raises(DeviceError, match="FAULT|NOT_READY"):
        here.bench.start()
    assert here.devices.drive == 0.0
    here.devices.clear(upset_valve)
    here.run()
    here.enable(1.0)
    wait_until(lambda: here.devices.drive == pytest.approx(1.0, abs=1e-3), "1 V at the spool")


def accepted(bench: Any) -> bool:
    """Whether a reset is; heartbeats, frames and positions recover a little after their cause has gone."""
    try:
        bench.reset()
        bench.follow(State.ACTIVE)
    except DeviceError:
        return False
    return True
