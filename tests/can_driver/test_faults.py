"""Every fault of the bench, provoked in virtual devices: 0 V, disabled, named, latched until `reset`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest

from hydraulic_can_driver.cia408 import State
from hydraulic_can_driver.errors import DeviceError
from hydraulic_can_driver.faults import Fault
from hydraulic_can_driver.virtual import faults as upset


@dataclass(frozen=True)
class Case:
    """An upset, the fault it must lead to, and words of the diagnostic.

    `lasts`: a reset is refused while it does. `after`: what releases it once it is over: reset, activate, configure.
    """

    upset: Any
    fault: Fault
    words: str
    lasts: bool = True
    after: str = "reset"
    settings: dict[str, Any] = field(default_factory=dict)


SOON = {"missed_cycles": 20}
CASES = {
    "heartbeat lost": Case(
        upset.HeartbeatStop("lvdt"), Fault.HEARTBEAT, "heartbeat: lvdt", settings={"heartbeats": 10}
    ),
    "EMCY of a sensor": Case(upset.Emergency("lvdt", 0x5000), Fault.EMERGENCY, "lvdt: EMCY 0x5000"),
    "EMCY of the valve": Case(upset.Emergency("valve", 0x3412, 4), Fault.EMERGENCY, "valve: EMCY 0x3412"),
    "status fault": Case(upset.StatusFault("valve"), Fault.EMERGENCY, "valve: EMCY 0x3412"),
    "missing frame": Case(upset.MissingPdo("pressure_b"), Fault.FRAMES, "pressure_b", after="activate", settings=SOON),
    "late frame": Case(upset.LatePdo("lvdt", 0.05), Fault.FRAMES, "lvdt", after="activate", settings=SOON),
    "wrong length": Case(upset.PdoLength("lvdt", 3), Fault.LENGTH, "3 bytes; mapped are 7", after="configure"),
    "jump": Case(upset.PositionJump("lvdt", 0.3), Fault.POSITION, "jumps by 0.3", lasts=False),
    "out of stroke": Case(upset.PositionStuck("lvdt", 0.9), Fault.POSITION, "out of the stroke"),
    "frozen": Case(upset.PositionFrozen("lvdt"), Fault.POSITION, "frozen", lasts=False),
    "cable of a transducer": Case(upset.CableBreak("pressure_a"), Fault.SENSOR, "pressure_a is not valid"),
    "cable of the LVDT": Case(upset.CableBreak("lvdt"), Fault.EMERGENCY, "lvdt: EMCY"),
    "cable of the spool": Case(upset.CableBreak("valve"), Fault.EMERGENCY, "valve: EMCY"),
    "power cut of a sensor": Case(upset.PowerCut("lvdt"), Fault.FRAMES, "lvdt", after="configure", settings=SOON),
    "power cut of the valve": Case(upset.PowerCut("valve"), Fault.FRAMES, "valve", after="configure", settings=SOON),
    "connector out": Case(upset.Unplugged("lvdt"), Fault.FRAMES, "lvdt", after="activate", settings=SOON),
    "bus-off": Case(upset.BusOff(), Fault.BUS, "bus-off", lasts=False),
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
    here.devices.clear(case.upset)
    loop.drive = 0.0
    if case.after == "reset":
        wait_until(lambda: accepted(here.bench), "a reset that is accepted")
    else:
        if case.after == "configure":
            wait_until(lambda: {Fault.RESTART, Fault.LENGTH} & here.bench.faults.latched, "a fault that stays")
            with pytest.raises(DeviceError, match="configure"):
                here.bench.reset()
        loop = here.again(boot=case.after == "configure")
    assert here.bench.problem == "" and here.devices.drive == 0.0
    here.enable(1.0)
    wait_until(lambda: here.devices.drive == pytest.approx(1.0, abs=1e-3), "1 V at the spool after the reset")


def accepted(bench: Any) -> bool:
    """Whether a reset is; heartbeats, frames and positions recover a little after their cause has gone."""
    try:
        bench.reset()
        bench.follow(State.ACTIVE)
    except DeviceError:
        return False
    return True
