"""The driver node against the virtual devices over the kernel's own CAN (SocketCAN, vcan), with candump as witness.

Under software emulation a program runs some twenty times slower: the bus has 2.5 Hz instead of 500, and the patience of
the bus file is stretched, so that a machine that is busy besides does not look like a fault. Frames, states and numbers
are the same.
"""

from __future__ import annotations

import json
import math
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML
from system import vcan
from system.vcan_guest import GAIN, LAG, START

from hydraulic_sysid.data.records import read_records
from hydraulic_sysid.estimation.metrics import best_fit
from hydraulic_sysid.linear.models import ArxOrder, fit_arx

pytest.importorskip("rclpy")

GUEST = Path(vcan.__file__).with_name("vcan_guest.py")
SHIPPED = Path(__file__).parents[2] / "hydraulic_can_driver" / "hydraulic_can_driver" / "buses" / "bench.yaml"
CHANNEL = "vcanbench"
RATE = 2.5  # the drive is sent a quarter of the period before its SYNC, and the loop wakes up to 50 ms late
SHORTEST = 5  # samples of a piece of the record between two lost ones
DURATION = 24.0  # of the excitation, s
PATIENCE_S = 10.0
MACHINE_S = 900.0  # a machine that is busy besides; with two free processors it takes a minute

PLAN = f"""
name: multisine
signal: {{kind: random_phase_multisine, rms: 1.0, period: 12.0, frequency_min: 0.1, frequency_max: 1.0, seed: 1}}
duration: {DURATION}
rate: {RATE}
fade_in: 0.25
fade_out: 0.25
centre: {START}
travel_limit: 0.6
"""
NODES = (0x10, 0x20, 0x30, 0x31, 0x32)
SYNC, DRIVE, STATUS, POSITION = 0x080, 0x510, 0x490, 0x1A0
SAMPLED = (STATUS, POSITION, 0x1B0, 0x1B1, 0x1B2)

pytestmark = [pytest.mark.timeout(MACHINE_S + 60.0), pytest.mark.timing]  # the kernel sends the SYNC


@dataclass
class Frame:
    """A line of candump: time of reception in the kernel [s], identifier, data."""

    time: float
    id: int
    data: bytes


@dataclass
class Run:
    """What a run left behind."""

    folder: Path
    frames: list[Frame]
    result: dict[str, Any]
    devices: dict[str, Any]
    logs: str

    def of(self, *ids: int) -> list[Frame]:
        """Frames with these identifiers, in order."""
        return [frame for frame in self.frames if frame.id in ids]


def write_bus(path: Path) -> None:
    """The shipped bus file at a rate that an emulated machine keeps, and with its patience."""
    yaml = YAML()
    bus = yaml.load(SHIPPED.read_text(encoding="utf-8"))
    bus["channel"], bus["rate"] = CHANNEL, RATE
    bus["master"].update(heartbeat=0.2, lost_after=PATIENCE_S)
    bus["limits"].update(frozen_travel=1.0, velocity=100.0)
    bus["monitoring"].update(frames_within=0.95, missed_cycles=500, heartbeats=60)
    bus["monitoring"].update(sync_gap=PATIENCE_S, state_change=PATIENCE_S)
    for node in bus["nodes"].values():
        node["heartbeat"] = 0.5
    valve = bus["nodes"]["valve"]
    valve["receive"][0]["timeout"] = PATIENCE_S
    valve["boot"].append({"object": 0x2201, "sub": 0, "type": "u16", "value": round(1e3 * PATIENCE_S)})
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(bus, file)


def frames(path: Path) -> list[Frame]:
    lines = re.findall(r"^\((\d+\.\d+)\) \S+ ([0-9A-F]{3})#([0-9A-F]*)", path.read_text(), re.MULTILINE)
    return [Frame(float(time), int(number, 16), bytes.fromhex(data)) for time, number, data in lines]


def run_guest(folder: Path) -> None:
    """On this kernel where it has vcan, else in a virtual machine; skips where there is neither."""
    here = vcan.lacking_here()
    if not here:
        with vcan.interface(CHANNEL):
            vcan.in_process(GUEST, CHANNEL, folder, folder / "machine.log", MACHINE_S)
        return
    lacking = vcan.lacking_machine()
    if lacking and os.environ.get(vcan.REQUIRED):
        pytest.fail(f"no vcan here ({here}), and no virtual machine: {lacking}")
    if lacking:
        pytest.skip(f"no vcan here ({here}), and no virtual machine: {lacking}")
    vcan.in_machine(GUEST, CHANNEL, folder, folder / "machine.log", MACHINE_S)


@pytest.fixture(name="run", scope="module")
def run_fixture(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("vcan")
    write_bus(folder / "bus.yaml")
    (folder / "plan.yaml").write_text(PLAN)
    run_guest(folder)
    logs = "\n".join(f"{log.name}:\n{log.read_text(errors='replace')}" for log in sorted(folder.glob("*.log")))
    logs = "\n".join(line for line in logs.splitlines() if f" {CHANNEL} " not in line)
    assert (folder / "result.json").is_file(), logs
    result = json.loads((folder / "result.json").read_text())
    assert result["codes"] == {"excitation": 0, "recorder": 0, "plant": 0, "devices": 0}, logs
    devices = json.loads((folder / "devices.json").read_text())
    return Run(folder, frames(folder / "candump.log"), result, devices, logs)


def test_devices_boot_are_asked_who_they_are_and_set_up_before_they_are_started(run: Run) -> None:
    for node in NODES:
        heard = [f for f in run.frames if f.id == 0x700 + node]
        assert heard[0].data == b"\x00"
        assert heard[-1].data == b"\x7f"
        asked = [f for f in run.frames if f.id == 0x600 + node]
        (started,) = (f for f in run.of(0) if f.data == bytes([1, node]))
        assert any(f.data[:4] == bytes([0x40, 0x00, 0x10, 0]) and f.time < started.time for f in asked)
        assert not any(f.id == 0x580 + node and f.data[0] == 0x80 for f in run.frames), "an SDO abort"
        if node != 0x10:
            continue  # mapped as delivered
        # The mapping: off, no entries, entries, their number, on (CiA 301, 7.5.2.38).
        place, entries = b"\x03\x18", b"\x03\x1a"
        writes = [f.data for f in asked if f.data[0] & 0xE0 == 0x20 and f.data[1:3] in (place, entries)]
        off = next(i for i, w in enumerate(writes) if w[1:4] == place + b"\x01" and w[7] & 0x80)
        none = next(i for i, w in enumerate(writes) if w[1:5] == entries + b"\x00\x00")
        on = max(i for i, w in enumerate(writes) if w[1:4] == place + b"\x01" and not w[7] & 0x80)
        assert off < none < on == len(writes) - 1
        assert all(f.time < started.time for f in asked if f.data in writes)
    assert run.frames[-1].time > run.of(SYNC)[-1].time


def test_the_state_machine_is_climbed_step_by_step_and_left_at_0(run: Run) -> None:
    words = [int.from_bytes(f.data[:2], "little") for f in run.of(DRIVE)]
    steps = [word for i, word in enumerate(words) if i == 0 or word != words[i - 1]]
    assert steps[:4] == [0, 1, 3, 7]
    assert steps[-2:] == [1, 0]
    states = [f.data[0] & 0xF for f in run.of(STATUS)]
    seen = [state for i, state in enumerate(states) if i == 0 or state != states[i - 1]]
    assert seen[:4] == [0b1000, 0b1001, 0b1011, 0b1111]
    assert states[-1] == 0b1000
    # Not a volt before the valve has said that it is active, and none after the control word has asked it not to be.
    drives = [int.from_bytes(f.data[2:4], "little", signed=True) for f in run.of(DRIVE)]
    assert max(map(abs, drives)) > 2000
    assert not any(drive for word, drive in zip(words, drives, strict=True) if word != 7)
    assert run.devices["drive"] == 0.0
    assert run.devices["state"] == "init"
    assert run.devices["error"] == ""
    assert not run.of(*(0x80 + node for node in NODES)), "an EMCY"


def test_the_kernel_sends_the_sync_and_every_device_answers_it(run: Run) -> None:
    syncs = np.array([f.time for f in run.of(SYNC)])
    assert len(syncs) > DURATION * RATE
    assert np.median(np.diff(syncs)) == pytest.approx(1.0 / RATE, rel=0.05)  # as good as an emulated clock
    answers = {number: len(run.of(number)) for number in SAMPLED}
    assert min(answers.values()) >= 0.97 * len(syncs), answers
    assert max(answers.values()) <= len(syncs), answers
    assert {len(f.data) for f in run.of(STATUS)} == {4}
    assert {len(f.data) for f in run.of(POSITION)} == {7}


def test_the_record_holds_what_was_on_the_wire(run: Run) -> None:
    """Decoded here by hand: 1 um and -0.762 m at 0 counts; 16384 counts for 10 V."""
    wire = np.array([int.from_bytes(f.data[:4], "little", signed=True) for f in run.of(POSITION)]) * 1e-6 - 0.762
    drives = np.array([int.from_bytes(f.data[2:4], "little", signed=True) for f in run.of(DRIVE)]) * 10.0 / 16384
    pieces = read_records(run.folder / "bag", "split")
    found = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0].channels}
    assert len(found["position"]) > 0.4 * DURATION * RATE
    assert share_among(found["position"], wire) > 0.95
    assert share_among(found["drive"], drives) > 0.95
    assert np.ptp(found["position"]) > 0.01
    assert found["pressure_a"] == pytest.approx(7e6, abs=1e3)
    assert found["pressure_supply"] == pytest.approx(14e6, abs=1e3)


def share_among(values: np.ndarray, allowed: np.ndarray) -> float:
    """Share of the values that are among others, but for rounding; what was interpolated is not."""
    near = np.sort(allowed)
    at = np.clip(np.searchsorted(near, values), 1, len(near) - 1)
    distance = np.minimum(np.abs(near[at] - values), np.abs(near[at - 1] - values))
    return float(np.mean(distance < 1e-9))


def test_the_plant_is_identified_from_the_record(run: Run) -> None:
    """Velocity gain and time constant of the virtual hydraulics.

    Sampled, they are 1 − (1 + p) z⁻¹ + p z⁻² with p = exp(−T/LAG), and b₁ + b₂ = GAIN · T · (1 − p).
    """
    pieces = [piece for piece in read_records(run.folder / "bag", "split") if len(piece) >= SHORTEST]
    assert sum(map(len, pieces)) > 0.33 * DURATION * RATE, f"pieces of {[len(piece) for piece in pieces]} samples"
    drives, positions = ([np.asarray(piece[name]) for piece in pieces] for name in ("drive", "position"))
    longest = int(np.argmax([len(piece) for piece in pieces]))
    half = len(pieces[longest]) // 2  # the second half of the longest piece is held out
    held_out = drives[longest][half:], positions[longest][half:]
    drives[longest], positions[longest] = drives[longest][:half], positions[longest][:half]
    model = fit_arx(drives, positions, 1.0 / RATE, ArxOrder(2, 2, 1))
    pole = math.exp(-1.0 / (RATE * LAG))
    assert model.a == pytest.approx([-1.0 - pole, pole], abs=0.01)
    assert model.b.sum() == pytest.approx(GAIN / RATE * (1.0 - pole), rel=0.03)
    assert best_fit(held_out[1][2:], model.predict(*held_out)[2:]) > 99.0
