"""Watches over time: heartbeats of the devices, gaps between SYNCs, cycles without all frames; keeps the counts."""

from __future__ import annotations

from collections.abc import Mapping

from hydraulic_can_driver.bus import Bus
from hydraulic_can_driver.faults import BusFault, FaultLatch
from hydraulic_can_driver.frames import Frames
from hydraulic_can_driver.receiver import STATES, Receiver

LATE = 0.25
"""A SYNC that is off its instant by more than this share of the period is late, and counted."""

_TYPICAL_STUFFING = 0.1  # share of the bits that are stuffed; at most it is 1 in 4


def frame_bits(length: int, worst: bool = True) -> float:
    """Bits of a frame with an 11-bit identifier and ``length`` bytes: with stuff bits and pause (ISO 11898-1)."""
    stuffed = 34 + 8 * length
    return 8 * length + 47 + ((stuffed - 1) // 4 if worst else _TYPICAL_STUFFING * stuffed)


def bus_load(bus: Bus, worst: bool = False) -> float:
    """Share of the bit rate that SYNC, process data and heartbeats take: typical, or the largest possible."""
    pdos = [pdo.length for node in bus.nodes.values() for pdo in (*node.receive, *node.transmit)]
    per_second = bus.rate * sum(frame_bits(length, worst) for length in (0, *pdos))
    beats = [bus.master.heartbeat, *(node.heartbeat for node in bus.nodes.values())]
    return (per_second + sum(frame_bits(1, worst) / beat for beat in beats if beat > 0.0)) / bus.bitrate


class Supervision:
    """Reports to `faults`; `begin`, `check` and `cycle` belong to the thread of the cycle."""

    def __init__(self, bus: Bus, receiver: Receiver, frames: Frames, faults: FaultLatch) -> None:
        self._bus, self._receiver, self._frames, self._faults = bus, receiver, frames, faults
        self._load = bus_load(bus)
        self._began = self._last_sync = 0.0
        self.cycles = self.missed = self.late = 0
        self._missed_in_a_row = 0
        self._worst_ns = 0

    def begin(self, now: float) -> None:
        """Everything is well at `now` (s)."""
        self._began = self._last_sync = now
        self._missed_in_a_row = 0

    def silent(self, now: float) -> list[str]:
        """Devices whose heartbeat is overdue."""
        patience, heard = self._bus.monitoring.heartbeats, self._receiver.heard
        return [
            f"{node.name} for {now - last:.2f} s"
            for node in self._bus.nodes.values()
            if node.heartbeat
            and now - (last := max(heard.get(node.name, 0.0), self._began)) > patience * node.heartbeat
        ]

    def check(self, now: float) -> None:
        """Before a cycle: have the devices been heard, and was the last SYNC not long ago?"""
        if silent := self.silent(now):
            self._faults.report(BusFault.HEARTBEAT, f"no heartbeat: {', '.join(silent)}")
        gap, limit = now - self._last_sync, self._bus.monitoring.sync_gap
        if gap > limit:
            text = f"no SYNC for {gap:.3f} s, allowed are {limit:g} s: the loop was held up"
            self._faults.report(BusFault.SYNC, text)
        self._last_sync = now

    def cycle(self, stamp_ns: int, complete: bool) -> None:
        """After a cycle: were all frames there, and was the SYNC where it belongs?"""
        self.cycles += 1
        deviation = abs(self._frames.sync_ns - stamp_ns)
        self._worst_ns = max(self._worst_ns, deviation)
        if deviation > LATE * 1e9 / self._bus.rate:
            self.late += 1
        if complete:
            self._missed_in_a_row = 0
            return
        self.missed += 1
        self._missed_in_a_row += 1
        if self._missed_in_a_row >= self._bus.monitoring.missed_cycles:
            who = ", ".join(self._frames.lacking()) or "the SYNC"
            self._faults.report(BusFault.FRAMES, f"no frames in time in {self._missed_in_a_row} cycles in a row: {who}")

    def report(self, now: float) -> Mapping[str, str]:
        """Rows for the diagnostics at `now` (s)."""
        receiver = self._receiver
        rows = {
            "bus_load_percent": f"{100.0 * self._load:.1f}",
            "cycles": str(self.cycles),
            "cycles_missed": str(self.missed),
            "syncs_late": str(self.late),
            "sync_deviation_max_ms": f"{self._worst_ns * 1e-6:.4f}",
            "frames_late": str(self._frames.late),
            "frames_unexpected": str(receiver.unexpected),
            "emergencies": " | ".join(receiver.emergencies),
            "fault_log": " | ".join(self._faults.log),
        }
        for fault, count in self._faults.counts.items():
            rows[f"faults_{fault.name.lower()}"] = str(count)
        for node in self._bus.nodes.values():
            state = receiver.states.get(node.name)
            told = "silent" if state is None else STATES.get(state, f"state {state}")
            age = now - receiver.heard[node.name] if node.name in receiver.heard else float("nan")
            rows[f"node_{node.name}"] = f"{told}, heartbeat {age:.3f} s ago"
        return rows
