"""The CAN driver's node and virtual devices over a cylinder of a few lines, in one process; takes the node's arguments.

The bus file is the shipped one with more patience: what is tested here is the contract, on a machine that may be busy.
"""

from __future__ import annotations

import signal
import sys
import tempfile
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from hydraulic_can_driver.bus_file import SHIPPED, load_bus
from hydraulic_can_driver.can_bus import open_can
from hydraulic_can_driver.nodes import can_driver
from hydraulic_can_driver.virtual import Reading, VirtualBench
from hydraulic_can_driver.virtual.faults import StatusFault
from hydraulic_can_driver.virtual.wiring import Event

GAIN, HALF_STROKE = 0.02, 0.5  # (m/s)/V, m
CHANGES: dict[str, dict[str, Any]] = {
    "": {"interface": "virtual", "channel": "contract", "rate": 100},  # devices and driver in one process
    "master": {"lost_after": 10.0},
    "monitoring": {"missed_cycles": 1000, "sync_gap": 10.0, "state_change": 10.0, "heartbeats": 100},
}


class Cylinder:
    """The velocity follows the drive at once; between stops, and at pressures that hardly change."""

    def __init__(self) -> None:
        self._position, self._velocity = 0.0, 0.0

    def step(self, drive: float, dt: float) -> Reading:
        """See `hydraulic_can_driver.virtual.Plant`."""
        now = Reading(self._position, self._velocity, 7e6 + 1e4 * drive, 7e6 - 1e4 * drive, 14e6, drive / 10.0)
        self._velocity = GAIN * drive
        self._position = min(max(self._position + self._velocity * dt, -HALF_STROKE), HALF_STROKE)
        return now


def patient_file(folder: Path, changes: dict[str, dict[str, Any]] = CHANGES) -> Path:
    """The shipped bus file with changes, by section ("" for the top)."""
    yaml = YAML(typ="rt")
    document = yaml.load(SHIPPED / "bench.yaml")
    for section, values in changes.items():
        (document[section] if section else document).update(values)
    document["nodes"]["valve"]["receive"][0]["timeout"] = 10.0
    document["nodes"]["valve"]["boot"].append({"object": 0x2201, "sub": 0, "type": "u16", "value": 10_000})
    path = folder / "patient.yaml"
    yaml.dump(document, path)
    return path


def tell(event: Event) -> None:
    """Print what the valve does."""
    if event.kind == "state":
        print(f"valve: {event.detail}", flush=True)


def main() -> int:
    """Run the node until it is told to stop; SIGUSR1 and SIGUSR2 begin and end a fault of the valve."""
    with tempfile.TemporaryDirectory() as folder:
        path = patient_file(Path(folder))
        bus = load_bus(path)
        fault = StatusFault("valve")
        lockstep = "--lockstep" in sys.argv
        with VirtualBench(bus, open_can(bus.interface, bus.channel), Cylinder(), lockstep) as devices:
            devices.listeners.append(tell)
            signal.signal(signal.SIGUSR1, lambda *_: devices.inject(fault))
            signal.signal(signal.SIGUSR2, lambda *_: devices.clear(fault))
            code = can_driver.main([*sys.argv[1:], "--ros-args", "-p", f"bus:={path}"])
            print(f"left behind: {devices.valve.machine.state.label}, {devices.drive:g} V", flush=True)
            return code


if __name__ == "__main__":
    sys.exit(main())
