"""What to check at the first power-on of a real bench, with the numbers of its bus file."""

from __future__ import annotations

from collections.abc import Iterator

from hydraulic_can_driver.bus import Bus, Node, Pdo, Signal
from hydraulic_can_driver.codec import raw_range, to_quantity

HEAVY_LOAD = 0.7
"""Share of the bit rate beyond which frames of low priority may come too late."""

_DEVICES = {408: "servo valve", 406: "displacement sensor", 404: "pressure transducer"}
_WORK_AREA = {(0x6401, 1): "limit switch retracted", (0x6402, 1): "limit switch extended"}
_FIRST_DRIVE_V = 0.2


def frame_bits(length: int) -> int:
    """Most bits of a frame with an 11-bit identifier and ``length`` bytes: with stuff bits and pause (ISO 11898-1)."""
    return 8 * length + 47 + (34 + 8 * length - 1) // 4


def bus_load(bus: Bus) -> float:
    """Largest share of the bit rate that SYNC, process data and heartbeats take."""
    cyclic = frame_bits(0) + sum(
        frame_bits(pdo.length) for node in bus.nodes.values() for pdo in (*node.receive, *node.transmit)
    )
    beats = [bus.master.heartbeat, *(node.heartbeat for node in bus.nodes.values())]
    return (cyclic * bus.rate + sum(frame_bits(1) / beat for beat in beats if beat > 0.0)) / bus.bitrate


def warnings(bus: Bus) -> list[str]:
    """What in the bus file itself deserves a second look."""
    found = []
    load = bus_load(bus)
    if load > HEAVY_LOAD:
        found.append(
            f"The bus is loaded to {load:.0%} at {bus.rate:g} Hz; above {HEAVY_LOAD:.0%} frames come too late."
        )
    for node in bus.nodes.values():
        if not node.identity:
            found.append(f"`{node.name}`: no identity is checked; another device on its node ID would not be noticed.")
        if node.heartbeat <= 0.0:
            found.append(f"`{node.name}`: sends no heartbeat; its loss shows only in missing frames.")
    if bus.drive_pdo.timeout <= 0.0:
        found.append("The valve does not watch for missing set-points (`timeout` of its frame is 0).")
    if bus.signal("switches") is None:
        found.append("No limit switches: nothing but the position stops a drive into an end.")
    if bus.signal("pressure_supply") is None:
        found.append("No supply pressure: a frozen position sensor is told only by the spool.")
    return found


def checklist(bus: Bus) -> str:
    """The list as Markdown."""
    parts = [_head(bus), _wiring(bus), _power(bus), _signals(bus), _supervision(bus), _hydraulics(bus), _movement(bus)]
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def _box(text: str) -> str:
    return f"- [ ] {text}"


def _head(bus: Bus) -> Iterator[str]:
    yield f"# First power-on: {bus.name}"
    yield ""
    yield f"{bus.description or bus.name} From `{bus.path.name}`. Checked by: ____________  Date: ____________"
    found = warnings(bus)
    if found:
        yield ""
        yield "**Look at these lines of the bus file first:**"
        yield ""
        yield from (_box(text) for text in found)


def _wiring(bus: Bus) -> Iterator[str]:
    yield "## 1. Wiring, everything off"
    yield ""
    yield _box("Supply of the pump locked off; accumulator drained; piston free of people and tools.")
    yield _box("Resistance between CAN_H and CAN_L: 60 ohm (two terminators of 120 ohm, at the two ends).")
    yield _box("CAN_H, CAN_L and CAN_GND each wired through; shield earthed at one end; no stub longer than 0.3 m.")
    yield _box(f"Every device is set to {bus.bitrate / 1000:g} kbit/s and to its node ID:")
    yield ""
    yield "| device | profile | node ID | heartbeat | identity that is checked |"
    yield "|---|---|---|---|---|"
    for node in bus.nodes.values():
        identity = ", ".join(f"{name} 0x{value:X}" for name, value in node.identity.items()) or "none"
        beat = f"{node.heartbeat * 1e3:g} ms" if node.heartbeat > 0.0 else "none"
        what = _DEVICES.get(node.profile, "device")
        yield f"| `{node.name}`, {what} | CiA {node.profile} | 0x{node.id:02X} ({node.id}) | {beat} | {identity} |"
    yield ""
    yield _box("The emergency stop cuts the pump and the supply of the valve by hardware, without this computer.")


def _power(bus: Bus) -> Iterator[str]:
    yield "## 2. Electronics on, hydraulics off"
    yield ""
    if bus.interface == "socketcan":
        yield _box(f"`ip link set {bus.channel} up type can bitrate {bus.bitrate} restart-ms 0`")
        boots = ", ".join(f"{0x700 + node.id:X}#00" for node in bus.nodes.values())
        yield _box(f"`candump {bus.channel}` while the devices are switched on shows one boot-up each: {boots}.")
        yield _box(f"`ip -s -d link show {bus.channel}`: state ERROR-ACTIVE, no bus errors counted.")
    yield _box(f"Expected load of the bus at {bus.rate:g} Hz: at most {bus_load(bus):.0%}.")
    yield _box("No second master is on the bus: `candump` shows nothing on these identifiers before the driver runs:")
    yield ""
    yield "| identifier | from | what |"
    yield "|---|---|---|"
    yield "| 0x080 | driver | SYNC |"
    for node in bus.nodes.values():
        for pdo, way in [(pdo, "driver") for pdo in node.receive] + [(pdo, node.name) for pdo in node.transmit]:
            yield f"| 0x{pdo.cob_id:03X} | {way} | {_content(pdo)} |"
    yield ""
    yield _box(
        "The valve is not active after power-on: its status word (0x6041) has no bit 2. Some order codes go active."
    )
    yield _box("`inspect` reads every device, and each value that is not neutral is meant to be so:")
    yield ""
    yield "| device | object | value that changes nothing | else it acts like |"
    yield "|---|---|---|---|"
    for node in bus.nodes.values():
        for row in node.inspect:
            unit = row.scale.unit.replace("1", "")
            neutral = "any" if row.neutral is None else f"{row.neutral:g} {unit}".strip()
            yield f"| `{node.name}` | {row.address} {row.name} | {neutral} | {row.effect or '—'} |"


def _content(pdo: Pdo) -> str:
    return f"{', '.join(signal.name for signal in pdo.signals)} ({pdo.length} bytes)"


def _signals(bus: Bus) -> Iterator[str]:
    yield "## 3. Signals, hydraulics off"
    yield ""
    yield _box(
        "Each quantity reads what a gauge or a rule says, within its tolerance (`ros2 topic echo /actuator/state`):"
    )
    yield ""
    yield "| signal | one count | range of the frame | read | by gauge |"
    yield "|---|---|---|---|---|"
    for _, _, signal in bus.signals():
        if signal.scale.unit:
            low, high = _range(signal)
            unit = signal.scale.unit
            yield f"| {signal.name} | {abs(signal.scale.gain):.4g} {unit} | {low:.4g} … {high:.4g} {unit} | | |"
    yield ""
    low, high = bus.limits.position
    yield _box(
        f"Position: piston pushed out by hand or jack reads *more*; mid-stroke is 0, the ends {low:g} and {high:g} m."
    )
    for text in _switches(bus):
        yield _box(text)
    yield _box("Pressures read 0 within their tolerance with the system drained.")


def _range(signal: Signal) -> tuple[float, float]:
    ends = sorted(to_quantity(raw, signal.scale) for raw in raw_range(signal.address.type))
    return ends[0], ends[1]


def _switches(bus: Bus) -> Iterator[str]:
    position = bus.signal("position")
    for node in bus.nodes.values():
        for write in node.boot:
            name = _WORK_AREA.get((write.address.index, write.address.sub))
            if name and position is not None:
                at = to_quantity(write.value, position.scale)
                yield f"{name} ({write.address} of `{node.name}`) closes at {at:.4g} m."
    switches = bus.signal("switches")
    if switches is not None:
        bits = ", ".join(f"{name} bit {bit}" for name, bit in switches.bits.items())
        yield f"Both switches seen in `{switches.address}`: {bits}; each closed by hand shows on its topic."


def _supervision(bus: Bus) -> Iterator[str]:
    lost = [bus.master.lost_after, bus.drive_pdo.timeout]  # heartbeats of the driver, set-points
    first = min(seconds for seconds in lost if seconds > 0.0)
    yield "## 4. Supervision, hydraulics off, driver active and enabled at 0 V"
    yield ""
    yield "Each must be tried once; after each, `reset` and a new activation as the message says."
    yield ""
    yield _box(f"Driver killed (`kill -9`): the valve leaves ACTIVE within {first:g} s, and its spool centres.")
    for node in bus.nodes.values():
        yield _box(f"Connector of `{node.name}` pulled: {_noticed(bus, node)}.")
    yield _box(f"CAN cable pulled at the computer: a fault; the valve centres within {first:g} s.")
    yield _box("Emergency stop by hardware, and by the service `emergency_stop`: latched until `reset`.")
    yield _box(f"Supply of `{bus.valve.name}` off and on while active: it does not go active again by itself.")


def _noticed(bus: Bus, node: Node) -> str:
    cycles = bus.monitoring.missed_cycles / bus.rate
    beats = f", heartbeat lost within {bus.monitoring.heartbeats * node.heartbeat:g} s" if node.heartbeat else ""
    return f"0 V and a fault that names it, within {cycles:g} s{beats}"


def _hydraulics(bus: Bus) -> Iterator[str]:
    yield "## 5. Before the hydraulics are switched on"
    yield ""
    yield _box("Guards closed, area clear, emergency stop in reach of whoever starts.")
    yield _box("Driver active but *not* enabled: drive 0 V, spool reads 0 within 1 %.")
    yield _box("Pressure relief set to the lowest pressure at which the piston moves; raised only after part 6.")
    yield _box("Hoses, fittings and oil level checked; bleed screws ready.")


def _movement(bus: Bus) -> Iterator[str]:
    drive = next(signal for signal in bus.drive_pdo.signals if signal.name == "drive")
    counts = round(_FIRST_DRIVE_V / abs(drive.scale.gain))
    yield "## 6. First movement, lowest pressure"
    yield ""
    yield _box("Pump on, not enabled: the piston stands or creeps slowly (valve null); pressures plausible.")
    yield _box(
        f"Enabled, {_FIRST_DRIVE_V:g} V ({counts} counts): the piston *extends* and the position rises. "
        "If not: stop, and turn `sign` of the drive (or of the position) in the bus file."
    )
    yield _box(
        f"{-_FIRST_DRIVE_V:g} V: it retracts. Pressure A rises against a stop when extending, B when retracting."
    )
    yield _box("Slowly into each limit switch: the drive further into it is refused, out of it is obeyed.")
    low, high = bus.limits.position
    yield _box(
        f"Ends of the stroke reached slowly read {low:g} and {high:g} m within {bus.limits.position_margin:g} m."
    )
    yield _box("Only now: working pressure, and the first excitation with a small amplitude and travel limit.")
