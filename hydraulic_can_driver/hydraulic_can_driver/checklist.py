"""What to check at the first power-on of a real bench, with the numbers of its bus file.

The list itself is a template, ``checklist.md.j2``.
"""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined

from hydraulic_can_driver.bus import Bus, Signal
from hydraulic_can_driver.codec import raw_range, to_quantity
from hydraulic_can_driver.supervision import bus_load

HEAVY_LOAD = 0.7
"""Share of the bit rate beyond which frames of low priority may come too late."""

_DEVICES = {408: "servo valve", 406: "displacement sensor", 404: "pressure transducer"}
_WORK_AREA = {(0x6401, 1): "limit switch retracted", (0x6402, 1): "limit switch extended"}
_FIRST_DRIVE_V = 0.2


def warnings(bus: Bus) -> list[str]:
    """What in the bus file itself deserves a second look."""
    found = []
    load = bus_load(bus, worst=True)
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
        found.append("The valve does not watch for missing set-points (`timeout` of its frame is none).")
    lost, braking = max(bus.master.lost_after, bus.drive_pdo.timeout), bus.limits.braking
    if braking is None:
        found.append("No braking before the ends of travel: any source may drive the piston into a stop at full speed.")
    elif braking.reaction < lost:
        found.append(
            f"Braking reckons with {braking.reaction:g} s of reaction, the valve goes on for up to {lost:g} s when its "
            "driver is lost: near an end it may then meet the stop faster than `impact_speed`."
        )
    if bus.signal("switches") is None:
        found.append("No limit switches: nothing but the position stops a drive into an end.")
    if bus.signal("pressure_supply") is None:
        found.append("No supply pressure: a frozen position sensor is told only by the spool.")
    return found


def checklist(bus: Bus) -> str:
    """The list as Markdown."""
    loader = PackageLoader("hydraulic_can_driver", "")
    templates = Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    drive = next(signal for signal in bus.drive_pdo.signals if signal.name == "drive")
    lost = [bus.master.lost_after, bus.drive_pdo.timeout]  # heartbeats of the driver, set-points
    return templates.get_template("checklist.md.j2").render(
        bus=bus,
        warnings=warnings(bus),
        load=bus_load(bus, worst=True),
        devices=_DEVICES,
        work_area=_WORK_AREA,
        range_of=_range,
        to_quantity=to_quantity,
        lost_after=min(seconds for seconds in lost if seconds > 0.0),
        first_drive=_FIRST_DRIVE_V,
        first_counts=round(_FIRST_DRIVE_V / abs(drive.scale.gain)),
    )


def _range(signal: Signal) -> list[float]:
    """Least and largest quantity that a signal can carry."""
    return sorted(to_quantity(raw, signal.scale) for raw in raw_range(signal.address.type))
