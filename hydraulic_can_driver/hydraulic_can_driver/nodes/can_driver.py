"""The bench on a CAN bus behind the topic contract: servo valve (CiA 408), LVDT (406), pressure transducers (404)."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from hydraulic_can_driver import readback
from hydraulic_can_driver.bench import Bench
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_can_driver.can_bus import programs_only
from hydraulic_can_driver.cia408 import State, describe
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.nodes.running import run_plant
from hydraulic_plant_node.plant_backend import PlantBackend
from hydraulic_plant_node.travel_limits import EndsOfTravel

PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec("bus", "bench", "bus file, or the name of a shipped one"),
    ParameterSpec("interface", "", "python-can interface (socketcan, udp_multicast, ...); empty: that of the bus file"),
    ParameterSpec("channel", "", "channel of the interface (can0, group:port, ...); empty: that of the bus file"),
    ParameterSpec("rate", 0.0, "SYNCs and samples per second; 0: as in the bus file", "Hz", 0.0, 1000.0),
)


class CanPlant(PlantBackend):
    """A plant whose sensors and valve are devices on a CAN bus."""

    hardware_id = "can"
    tolerated_lateness = 0.5

    def __init__(self) -> None:
        self._bench: Bench | None = None
        self._description: dict[str, Any] = {}
        self._priority = 0

    def parameters(self) -> Sequence[ParameterSpec]:
        """See `PlantBackend.parameters`."""
        return PARAMETERS

    def hardware(self, values: Mapping[str, Any]) -> str:
        """Interface and channel, unless only programs are on it.

        :raises BusFileError: the bus file is not acceptable.
        """
        bus = load_bus(values["bus"])
        interface, channel = values["interface"] or bus.interface, values["channel"] or bus.channel
        return "" if programs_only(interface, channel) else f"{interface} {channel}"

    def configure(self, values: Mapping[str, Any]) -> Sequence[ParameterSpec]:
        """Open the bus, check who is there, boot and map all devices, read back what they are set to.

        :raises BusFileError: the bus file is not acceptable.
        :raises BusDownError: the interface cannot be used.
        :raises DeviceError: a device does not answer, is another one, or refuses something.
        """
        bus = load_bus(values["bus"])
        bus = replace(bus, rate=values["rate"] or bus.rate)
        self.hardware_id = f"can: {bus.name}"
        self.unprotected = bus.unprotected
        self._bench = Bench(bus, values["interface"], values["channel"], values["lockstep"])
        self._priority = min(values["realtime_priority"] + 1, 98) if values["realtime_priority"] else 0
        self._bench.boot()
        self._description = readback.description(bus, self._bench.readings)
        return ()

    def sampling_rate(self, values: Mapping[str, Any]) -> float:
        """That of the SYNC."""
        return self._configured.bus.rate

    def ends_of_travel(self) -> EndsOfTravel | None:
        """What the bus file says about braking."""
        return self._configured.bus.limits.braking

    def activate(self) -> None:
        """All devices operational, the valve DISABLED at 0 V.

        :raises DeviceError: it does not come to that.
        """
        self._configured.start()
        self.fault = self.warning = ""

    def set_enabled(self, on: bool) -> None:
        """Lead the valve to ACTIVE or DISABLED and see that it gets there.

        :raises DeviceError: it does not.
        """
        if self._bench is not None and self._bench.operational:
            self._bench.follow(State.ACTIVE if on else State.DISABLED)

    def first_instant(self, earliest_ns: int) -> int:
        """The drive goes out in time for a SYNC."""
        # Not before: the loop gives the other threads of the process their priority when it is started.
        self._configured.receiver.priority = self._priority
        return self._configured.beat.first_instant(earliest_ns)

    def step(self, stamp_ns: int, drive: float, dt: float) -> PlantSample | None:
        """One SYNC; see `Bench.cycle`."""
        bench = self._configured
        sample = bench.cycle(stamp_ns + bench.beat.lead_ns, drive)
        self.fault = bench.problem
        closed = bench.measuring.closed
        self.warning = f"{' and '.join(closed)}: no drive further into it" if closed else ""
        return sample

    def deactivate(self) -> None:
        """0 V and disabled.

        :raises DeviceError: the valve was not seen to be so.
        """
        if self._bench is not None:
            self._bench.stop()

    def reset(self) -> None:
        """Reset the fault of the valve, and forget those whose cause is gone.

        :raises DeviceError: it is not.
        """
        if self._bench is not None:
            self._bench.reset()
        self.fault = ""

    def cleanup(self) -> None:
        """Give the bus back."""
        bench, self._bench = self._bench, None
        self._description = {}
        if bench is not None:
            bench.close()

    def report(self) -> Mapping[str, str]:
        """State of the valve, the devices and the bus."""
        bench = self._bench
        if bench is None:
            return {}
        status = bench.machine.status
        return {
            "valve": "unknown" if status is None else describe(status),
            "sync": bench.beat.sender,
            "settings": "; ".join(readback.sentences(bench.bus, bench.readings)) or "neutral",
            **bench.supervision.report(bench.now()),
        }

    def description(self) -> Mapping[str, Any]:
        """What is on the bus, and what it does to drive and measurements by itself."""
        return {**super().description(), **self._description}

    @property
    def _configured(self) -> Bench:
        if self._bench is None:
            raise RuntimeError("not configured")
        return self._bench


def main(argv: list[str] | None = None) -> int:
    """Run the driver node."""
    return run_plant(
        CanPlant(), "Servo valve, LVDT and pressure transducers on a CAN bus, on the bench's topics.", argv
    )


if __name__ == "__main__":
    sys.exit(main())
