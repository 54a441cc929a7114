"""Bus files: the shipped ones, and every refusal with file, line, value and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus_file import SHIPPED, load_bus, shipped
from hydraulic_can_driver.errors import BusFileError
from hydraulic_can_driver.supervision import bus_load

TEXT = (SHIPPED / "bench.yaml").read_text()


@pytest.mark.parametrize("name", shipped())
def test_shipped_files(name: str) -> None:
    bus = load_bus(name)
    assert bus.valve.profile == 408 and bus.drive_pdo.length == 4
    assert 0.0 < bus_load(bus) < 0.7


def test_scaling_of_the_shipped_file() -> None:
    bus = load_bus("bench")
    drive = bus.drive_pdo.signals[1].scale
    position = bus.signal("position")
    assert position is not None
    assert drive.gain * 16384 == 10.0 and position.scale.gain == 1e-6 and position.scale.offset == -0.762


def test_load_of_the_bus() -> None:
    # SYNC and five to seven frames of at most 7 bytes, 500 times a second, at 1 Mbit/s.
    assert bus_load(load_bus("bench")) == pytest.approx(0.29, abs=0.02)


SWITCHES = next(line for line in TEXT.splitlines(keepends=True) if "signal: switches" in line)
BRAKING = TEXT[TEXT.index("  braking:") : TEXT.index("  frozen_travel:")]

REFUSED = {
    "no such file": (None, "", "cannot be read"),
    "not YAML": ("format: hydraulic-bus-1", "format: [", "not YAML"),
    "format": ("hydraulic-bus-1", "hydraulic-bus-9", "bus.yaml:6: format is 'hydraulic-bus-9'"),
    "unknown key": ("rate: 500", "rate: 500\nsped: 1", "has no key 'sped'; allowed:"),
    "rate": ("rate: 500", "rate: 5000", "rate is 5000; allowed: 1 ... 1000"),
    "type of a value": ("rate: 500", "rate: fast", "rate is 'fast'; expected float"),
    "missing": ("interface: socketcan", "# none", "the bus has no 'interface'"),
    "impatient master": ("lost_after: 0.1 ", "lost_after: 0.03", "at least two heartbeats"),
    "stroke": ("[-0.762, 0.762]", "[0.762, -0.762]", "expected [lowest, highest]"),
    "same id": ("id: 0x31", "id: 0x30", "has id 0x30, which is that of pressure_a"),
    "id of the master": ("id: 0x31", "id: 0x7F", "that of master"),
    "same COB-ID": ("cob_id: 0x1B1", "cob_id: 0x1B0", "is used by pressure_a too"),
    "COB-ID": ("cob_id: 0x1B1", "cob_id: 0x80", "cob_id is 128; allowed"),
    "unknown signal": ("signal: velocity", "signal: speed", "signal is 'speed'; allowed here:"),
    "unknown type": (
        "sub: 1, type: i32, value: 1000,",
        "sub: 1, type: long, value: 1000,",
        "type is 'long'; allowed: u8",
    ),
    "unit": ("value: 5.0e-5, unit: m/s", "value: 5.0e-5, unit: mm/s", "unit is 'mm/s'; expected 'm/s'"),
    "no counts": ("counts: 1, value: 5.0e-5", "counts: 0, value: 5.0e-5", "neither may be 0"),
    "sign": ("value: 5.0e-5, unit", "value: 5.0e-5, sign: 2, unit", "sign is 2; allowed: 1, -1"),
    "boot value": ("type: i8, value: 1,", "type: i8, value: 300,", "value is 300; allowed: -128 ... 127"),
    "type in the EDS": (
        "sub: 0, type: i32, counts",
        "sub: 0, type: f32, counts",
        "0x6004:0 is f32; in lvdt_406.eds it is i32",
    ),
    "object of the EDS": ("object: 0x6005, sub: 1", "object: 0x6007, sub: 1", "0x6007:1 is no object of lvdt_406.eds"),
    "EDS file": ("eds: lvdt_406.eds", "eds: lvdt_407.eds", "no EDS file 'lvdt_407.eds'"),
    "switch bits": ("limit_retracted: 2", "limit_retarded: 2", "expected ['limit_extended', 'limit_retracted']"),
    "switch of a reading": ("switch: ramp_type", "switch: ramps", "switch 'ramps' is none of"),
    "identity": ("{vendor: 0x28}", "{maker: 0x28}", "has no key 'maker'"),
    "transmission": ("transmission: 1   # after", "transmission: 255   # after", "needs a frame with every SYNC"),
    "status word": ("signal: status_word", "signal: pressure_a_status", "mapped twice"),
    "signed word": (
        "signal: status_word, object: 0x6041, sub: 0, type: u16",
        "signal: status_word, object: 0x6041, sub: 0, type: i16",
        "expected one without sign",
    ),
    "no position": (
        "signal: position, object: 0x6004, sub: 0, type: i32, counts: 1, value: 1.0e-6, offset: -0.762, unit: m",
        "signal: position_status, object: 0x6004, sub: 0, type: u32",
        "no frame carries position",
    ),
    "no heartbeat": (
        "    heartbeat: 0.05\n",
        "",
        "has no 'heartbeat': its period, s; a bench without it says heartbeat: none",
    ),
    "heartbeat of 0": ("    heartbeat: 0.05\n", "    heartbeat: 0\n", "heartbeat is 0; allowed: 0.001 ... 1"),
    "no drive timeout": ("timeout: 0.1 ", "# ", "has no 'timeout': after how many s the valve misses a drive"),
    "no switches": (SWITCHES, "", "has no 'limit_switches': no frame carries switches"),
    "switches and none": ("rate: 500", "rate: 500\nlimit_switches: none", "has no key 'limit_switches'"),
    "no braking": (BRAKING, "", "has no 'braking': slew and speed before the stops; a bench without it says"),
    "impact speed": ("impact_speed: 0.05", "impact_speed: 5", "impact_speed is 5; allowed: 0.0001 ... 1"),
    "two valves": (
        "    transmit:             # TxPDO",
        "      - {number: 5, cob_id: 0x511, timeout: none, map: []}\n    transmit: # TxPDO",
        "a frame carries 1 ... 8",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str, tmp_path: Path) -> None:
    old, new, words = REFUSED[case]
    path = tmp_path / "bus.yaml"
    if old is not None:
        assert old in TEXT
        path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(BusFileError) as caught:
        load_bus(path)
    assert str(path) in str(caught.value) and words in str(caught.value)


def test_protection_that_a_bench_does_without_is_named(tmp_path: Path) -> None:
    """Each by an explicit `none`, or the file is refused (above)."""
    assert load_bus("bench").unprotected == ()
    path = tmp_path / "bus.yaml"
    text = TEXT.replace(BRAKING, "  braking: none\n").replace(SWITCHES, "").replace("timeout: 0.1 ", "timeout: none ")
    path.write_text(
        text.replace("heartbeat: 0.05", "heartbeat: none").replace("\nrate:", "\nlimit_switches: none\nrate:", 1)
    )
    bus = load_bus(path)
    assert bus.unprotected == (
        *(f"heartbeat of {name}" for name in bus.nodes),
        "drive timeout of the valve",
        "limit switches",
        "braking before the ends of travel",
    )
    assert bus.limits.braking is None and bus.drive_pdo.timeout == 0.0 and bus.valve.heartbeat == 0.0


@pytest.mark.parametrize(
    ("old", "name"), [("lost_after: 0.1 ", "lost_after"), ("timeout: 0.1 ", "timeout of the drive")]
)
def test_a_real_valve_does_not_go_on_for_long_without_its_driver(old: str, name: str, tmp_path: Path) -> None:
    path = tmp_path / "bus.yaml"
    path.write_text(TEXT.replace(old, old.replace("0.1", "10.0")))
    with pytest.raises(BusFileError, match=rf"{name} is 10 s; allowed on socketcan can7, .*: up to 0.5 s"):
        Bench(load_bus(path), "socketcan", "can7")
    Bench(load_bus(path), "virtual", name).close()
