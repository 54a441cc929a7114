"""Every fault of the virtual devices as a raw station on the bus sees it, its end, and moments of the dialogue."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from can_driver.station import DRIVE, LVDT, POSITION, PRESSURE, PRESSURE_A, STATUS, VALVE, Station

from hydraulic_can_driver.virtual import faults
from hydraulic_can_driver.virtual.faults import FAULTS, PowerCut
from hydraulic_can_driver.virtual.wiring import Event

HEALTHY = "30270d00000000"  # 0.1 m, 0 m/s, within the work area


@pytest.fixture(name="far")
def far_fixture() -> Iterator[Station]:
    with Station() as station:
        station.start()
        yield station


CASES = [
    (faults.PositionJump("lvdt", 0.05), "80ea0d00000000"),
    (faults.LimitSwitch("lvdt", "extended"), "30270d00000002"),
    (faults.LimitSwitch("lvdt", "retracted"), "30270d00000004"),
    (faults.PdoLength("lvdt", 3), "30270d"),
    (faults.PdoLength("lvdt", 8), "30270d0000000000"),
]


@pytest.mark.parametrize(("fault", "seen"), CASES, ids=lambda case: getattr(case, "node", "") and repr(case))
def test_what_the_displacement_sensor_sends(far: Station, fault: faults.InjectedFault, seen: str) -> None:
    assert far.sync(POSITION) == HEALTHY
    far.bench.inject(fault)
    assert far.sync(POSITION) == seen
    far.bench.clear(fault)
    assert far.sync(POSITION) == HEALTHY


@pytest.mark.parametrize(
    ("fault", "raw"), [(faults.PositionFrozen("lvdt"), 862_000), (faults.PositionStuck("lvdt", -0.2), 562_000)]
)
def test_a_position_that_stands_still_but_for_a_count(far: Station, fault: faults.InjectedFault, raw: int) -> None:
    assert far.sync(POSITION) == HEALTHY
    far.bench.inject(fault)
    far.plant.reading["position"] = 0.2
    frames = [bytes.fromhex(far.sync(POSITION)) for _ in range(4)]
    assert {int.from_bytes(frame[:4], "little", signed=True) for frame in frames} == {raw, raw + 1}
    assert {frame[4:].hex() for frame in frames} == {HEALTHY[8:]}
    far.bench.clear(fault)
    assert far.sync(POSITION) == "d0ad0e00000000"


def test_missing_and_late(far: Station) -> None:
    far.bench.inject(faults.MissingPdo("lvdt", 2))
    for _ in range(2):
        far.sync(PRESSURE)
        assert far.frames(POSITION, patience=0.05) == []
    assert far.sync(POSITION) == HEALTHY
    far.bench.inject(faults.LatePdo("lvdt", 0.2))
    far.sync(PRESSURE)
    assert far.frames(POSITION, patience=0.05) == []
    assert far.frame(POSITION) == HEALTHY


def test_heartbeats_stop_and_come_again(far: Station) -> None:
    far.sdo(LVDT, "2b171000 1400")
    assert far.frame(0x720) == "05"
    far.bench.inject(faults.HeartbeatStop("lvdt"))
    far.drain()
    assert far.frames(0x720, patience=0.2) == []
    far.bench.clear(faults.HeartbeatStop("lvdt"))
    assert far.frame(0x720) == "05"


@pytest.mark.parametrize(
    ("fault", "cob_id", "begins", "ends"),
    [
        (faults.Emergency("lvdt", 0x8110, 0x11), 0xA0, "1081110000000000", "0000000000000000"),
        (faults.CableBreak("lvdt"), 0xA0, "0050810000000000", "0000000000000000"),
        (faults.CableBreak("pressure_a"), 0xB0, "0050810000000000", "0000000000000000"),
        (faults.CableBreak("valve"), 0x90, "0150810000000000", "0000000000000000"),
        (faults.StatusFault("valve"), 0x90, "1234050000000000", "0000000000000000"),
    ],
)
def test_emergencies(far: Station, fault: faults.InjectedFault, cob_id: int, begins: str, ends: str) -> None:
    far.drain()
    far.bench.inject(fault)
    assert far.frame(cob_id) == begins
    far.bench.clear(fault)
    assert far.frame(cob_id) == ends


def test_a_broken_cable_shows_in_the_status(far: Station) -> None:
    far.bench.inject(faults.CableBreak("pressure_a"))
    assert far.sync(PRESSURE)[-2:] == "01"
    assert far.sdo(PRESSURE_A, "40007101") == "4b00710100000000"  # 0 mA
    far.bench.inject(faults.CableBreak("lvdt"))
    far.sync(PRESSURE)
    assert far.sdo(LVDT, "40036500") == "4b03650001000000"


def test_another_device_and_one_that_refuses(far: Station) -> None:
    far.bench.inject(faults.WrongIdentity("valve", 1, 0xBAD))
    assert far.sdo(VALVE, "40181001") == "43181001ad0b0000"
    far.bench.clear(faults.WrongIdentity("valve", 1, 0xBAD))
    assert far.sdo(VALVE, "40181001") == "4318100128000000"
    abort = faults.SdoAbort("valve", 0x6042, 0, 0x08000020)
    far.bench.inject(abort)
    assert far.sdo(VALVE, "2f426000 01") == "8042600020000008"
    assert far.sdo(VALVE, "40426000") == "8042600020000008"
    far.bench.clear(abort)
    assert far.sdo(VALVE, "40426000") == "4f42600001000000"


def test_power_cut_and_return(far: Station) -> None:
    far.activate()
    far.command(7, 8192)
    far.bench.inject(PowerCut("valve"))
    assert far.bench.drive == 0.0
    far.drain()
    far.send(0x610, "4041600000000000")
    far.send(DRIVE, "070000200000")
    far.send(0x80)
    assert far.frames(STATUS, 0x590, 0x710, patience=0.2) == []
    far.bench.clear(PowerCut("valve"))
    assert far.frame(0x710) == "00"
    assert far.sdo(VALVE, "40416000") == "4b41600008000000"


def test_unplugged_neither_hears_nor_speaks_and_gives_up(far: Station) -> None:
    far.activate()
    far.sdo(VALVE, "2b012200 6400")
    far.command(7, 8192)
    far.bench.inject(faults.Unplugged("valve"))
    far.send(DRIVE, "070000100000")
    far.send(0x80)
    assert far.frames(STATUS, patience=0.5) == []
    assert far.bench.drive == 0.0
    far.bench.clear(faults.Unplugged("valve"))
    assert far.sdo(VALVE, "40416000")[8:10] in ("03", "07", "01")


def test_bus_off_is_an_error_frame(far: Station) -> None:
    far.drain()
    far.bench.inject(faults.BusOff())
    frame = far._raw.recv(5.0)
    assert frame is not None and frame.is_error_frame
    assert frame.arbitration_id == 0x40


MOMENTS = [
    ("sdo read", "valve", "0x1018:1", lambda far: far.send(0x610, "4018100100000000")),
    ("sdo write", "valve", "0x6042:0", lambda far: far.send(0x610, "2f42600001000000")),
    ("nmt", "valve", "OPERATIONAL", lambda far: far.send(0, "0110")),
    ("state", "valve", "hold", lambda far: (far.send(DRIVE, "030000000000"), far.send(0x80))),
    ("rpdo", "valve", "4", lambda far: (far.send(DRIVE, "010000000000"), far.send(0x80))),
    ("sync", "", "2", lambda far: (far.sync(), far.send(0x80))),
]


@pytest.mark.parametrize(("kind", "node", "detail", "act"), MOMENTS, ids=[f"{m[0]} {m[2]}" for m in MOMENTS])
def test_power_can_fail_at_any_moment(far: Station, wait_until, kind, node, detail, act) -> None:  # type: ignore[no-untyped-def]
    heard: list[Event] = []
    far.bench.listeners.append(heard.append)
    far.bench.at(kind, node, detail, PowerCut("valve"))
    act(far)
    wait_until(lambda: not far.bench.valve.powered, "the power to fail", 20.0)
    assert Event(kind, node, detail) in heard
    assert far.bench.drive == 0.0
    if kind.startswith("sdo"):
        assert far.frames(0x590, patience=0.2) == []  # the answer is not sent any more


def test_a_later_moment_is_waited_for(far: Station) -> None:
    far.bench.at("sdo read", "valve", "0x1018:1", PowerCut("valve"), count=3)
    for _ in range(2):
        assert far.sdo(VALVE, "40181001").startswith("43")
    far.drain()
    far.send(0x610, "4018100100000000")
    assert far.frames(0x590, patience=0.3) == []


def test_faults_have_names_and_know_whom_they_befall() -> None:
    assert len(FAULTS) == 16
    with Station() as far:
        with pytest.raises(ValueError, match="no valve"):
            far.bench.inject(faults.StatusFault("lvdt"))
        with pytest.raises(ValueError, match="no LVDT"):
            far.bench.inject(faults.PositionJump("valve"))
