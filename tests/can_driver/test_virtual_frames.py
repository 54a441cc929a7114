"""Virtual devices byte by byte: what a raw station on the bus sends and gets. Layouts after CiA 301, 7.2 and 7.5."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from can_driver.station import DRIVE, LVDT, POSITION, PRESSURE, PRESSURE_A, STATUS, VALVE, Station, StillPlant


@pytest.fixture(name="far")
def far_fixture() -> Iterator[Station]:
    with Station() as station:
        yield station


def test_boot_up_and_identity(far: Station) -> None:
    booted = [frame for frame in far.drain() if frame[0] > 0x700]
    assert booted == [(0x710, "00"), (0x720, "00"), (0x730, "00"), (0x731, "00"), (0x732, "00")]
    assert far.sdo(VALVE, "40001000") == "4300100098010000"  # device type 408
    assert far.sdo(LVDT, "40001000") == "4300100096010800"
    assert far.sdo(PRESSURE_A, "40001000") == "4300100094010200"
    assert far.sdo(VALVE, "40181001") == "4318100128000000"  # vendor
    assert far.sdo(VALVE, "40010000") == "8001000000000206"  # no such object


def test_nothing_moves_and_nothing_is_sent_before_the_start(far: Station) -> None:
    far.drain()
    far.send(DRIVE, "070000200000")
    far.send(0x80)
    assert far.sdo(VALVE, "40416000") == "4b41600008000000"  # INIT
    assert STATUS not in [frame[0] for frame in far.drain()]
    assert set(far.plant.drives) == {0.0}


def test_every_sync_is_answered_once_with_what_holds(far: Station) -> None:
    far.start()
    far.drain()
    far.send(DRIVE, "010000000000")
    far.send(0x80)
    assert far.frame(STATUS) == "090000000000"
    assert far.frame(POSITION) == "30270d00000000"  # 862000 steps of 1 um, 0 mm/s, within the work area
    assert far.frame(PRESSURE) == "581b00"  # 70.00 bar
    assert far.frame(0x1B1) == "701700"
    assert far.frame(0x1B2) == "b03600"
    assert [frame for frame in far.drain() if frame[0] < 0x700] == []


def test_the_set_point_holds_from_the_next_sync_on(far: Station) -> None:
    far.activate()
    far.send(DRIVE, "070000200000")  # half of 16384
    assert far.plant.drives[-1] == 0.0
    assert far.sync() == "0f0000200000"
    assert far.plant.drives[-1] == pytest.approx(5.0)
    assert far.command(7, -8192) == "0f0000e00000"
    assert far.plant.drives[-1] == pytest.approx(-5.0)


def test_heartbeat_tells_the_state(far: Station) -> None:
    assert far.sdo(LVDT, "2b171000 3200") == "6017100000000000"  # 50 ms
    assert far.frame(0x720) == "7f"
    far.start(LVDT)
    assert "05" in far.frames(0x720, count=5)
    far.send(0, "0220")
    assert "04" in far.frames(0x720, count=5)
    assert far.sdo(LVDT, "2b171000 0000") == "6017100000000000"
    far.drain()
    assert far.frames(0x720, patience=0.2) == []


@pytest.mark.parametrize("command", ["81", "82"], ids=["node", "communication"])
def test_reset(far: Station, command: str) -> None:
    far.activate()
    far.command(7, 8192)
    far.drain()
    far.send(0, f"{command}10")
    assert far.frame(0x710) == "00"
    assert far.sdo(VALVE, "40416000") == "4b41600008000000"
    far.send(0x80)
    assert far.frames(STATUS, patience=0.3) == []
    assert far.bench.drive == 0.0


MAPPING = [
    ("23031a01 10004160", "8003 1a01 22000008"),  # while the frame is on: not in this state
    ("23031801 90040080", "6003180100000000"),  # off
    ("23031a01 10004160", "8003 1a01 22000008"),  # while it has entries
    ("2f031a00 00", "60031a0000000000"),
    ("23031a01 10001160", "80031a01 41000406"),  # 0x6011 cannot be mapped
    ("23031a01 10004060", "60031a0100000000"),
    ("23031a02 10010163", "60031a0200000000"),
    ("2f031a00 09", "80031a00 42000406"),  # more than a frame holds
    ("2f031a00 02", "60031a0000000000"),
    ("2f031802 fb", "80031802 30000906"),  # 251 is reserved
    ("2f031802 01", "6003180200000000"),
    ("23031801 92040000", "6003180100000000"),  # on, under another identifier
]


def test_a_mapping_changes_only_in_the_order_of_the_standard(far: Station) -> None:
    far.start()
    for request, answer in MAPPING:
        assert far.sdo(VALVE, request) == answer.replace(" ", ""), request
    far.send(DRIVE, "010000100000")
    far.send(0x80)
    assert far.frame(0x492) == "01000000"  # control word and spool


def test_a_frame_of_the_wrong_length_is_an_emergency(far: Station) -> None:
    far.activate()
    far.drain()
    far.send(DRIVE, "0700")
    assert far.frame(0x90) == "1082100402060000"  # 0x8210, communication; frame 4 has 2 bytes, mapped are 6
    assert far.sync() == "0f0000000000"
    far.send(DRIVE, "0700002000000000")
    assert far.frame(0x90) == "2082100408060000"
    assert far.sync()[:8] == "0f000020"  # what is mapped is taken


def test_values_beyond_their_limits_are_refused(far: Station) -> None:
    assert far.sdo(VALVE, "2f426000 03") == "8042600031000906"
    assert far.sdo(VALVE, "2f426000 00") == "8042600032000906"
    assert far.sdo(VALVE, "2b426000 0100") == "8042600010000706"  # two bytes for one
    assert far.sdo(VALVE, "2b416000 0000") == "8041600002000106"  # read only
    assert far.sdo(PRESSURE_A, "23316101 00000100") == "8031610130000906"  # no unit of a pressure


def test_the_error_history_begins_with_the_newest(far: Station) -> None:
    device = far.bench.devices["lvdt"]
    device.emergency(0x5000, 0x81)
    device.emergency(0xFF00, 0x81)
    assert far.sdo(LVDT, "40031000") == "4f03100002000000"
    assert far.sdo(LVDT, "40031001") == "4303100100ff0000"
    assert far.sdo(LVDT, "40031002") == "4303100200500000"
    assert far.sdo(LVDT, "40010000 ".replace("0100", "0110")) == "4f01100081000000"
    assert far.sdo(LVDT, "2f031000 00") == "6003100000000000"
    assert far.sdo(LVDT, "40031000") == "4f03100000000000"


def test_an_event_driven_frame_comes_by_its_timer(far: Station) -> None:
    for request in ("23001801 a0010080", "2f001802 fe", "2b001805 1400", "23001801 a0010000"):
        assert far.sdo(LVDT, request).startswith("60")
    far.drain()
    assert far.frames(POSITION, patience=0.2) == []
    far.start(LVDT)
    assert far.frames(POSITION, count=3) == ["30270d00000000"] * 3


def test_a_plant_without_hydraulics_has_no_valid_pressure() -> None:
    with Station(plant=StillPlant(pressure_a=float("nan"))) as far:
        far.start()
        assert far.sync(PRESSURE)[-2:] == "01"


def test_a_plant_that_fails_takes_the_power_from_all(wait_until: Any) -> None:
    class Breaking(StillPlant):
        def step(self, drive: float, dt: float) -> Any:
            if len(self.drives) > 3:
                raise ArithmeticError("no solution")
            return super().step(drive, dt)

    with Station(plant=Breaking()) as far:
        far.start()
        wait_until(lambda: far.bench.error, "the plant to fail")
        assert "no solution" in str(far.bench.error)
        assert not any(device.powered for device in far.bench.devices.values())
