"""What the devices do to drive and measurements by themselves, from the objects that were read back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hydraulic_can_driver.bus import Bus, Node, Reading


def acts(reading: Reading, rows: Mapping[str, Reading], values: Mapping[str, float]) -> bool:
    """Whether an object is set so that it changes something; never for one that has no neutral value."""
    if reading.neutral is None or _same(values[reading.name], reading):
        return False
    return not reading.switch or acts(rows[reading.switch], rows, values)


def settings(node: Node, values: Mapping[str, float]) -> list[dict[str, Any]]:
    """One row per object read back: name, object, value, unit, neutral value, whether it acts, effect it imitates."""
    rows = {reading.name: reading for reading in node.inspect}
    return [
        {
            "name": reading.name,
            "object": str(reading.address),
            "value": values[reading.name],
            "unit": reading.scale.unit,
            "neutral": reading.neutral,
            "acts": acts(reading, rows, values),
            "effect": reading.effect,
        }
        for reading in node.inspect
    ]


def description(bus: Bus, readings: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """What goes with every record: devices, their settings, and the physical effects that they imitate."""
    devices: dict[str, dict[str, Any]] = {
        name: {"profile": node.profile, "node_id": node.id, "settings": settings(node, readings.get(name, {}))}
        for name, node in bus.nodes.items()
        if name in readings
    }
    imitated = [
        row["effect"] for device in devices.values() for row in device["settings"] if row["acts"] and row["effect"]
    ]
    resolution = {
        signal.name: {"value": abs(signal.scale.gain), "unit": signal.scale.unit}
        for node in bus.nodes.values()
        for pdo in (*node.receive, *node.transmit)
        for signal in pdo.signals
        if signal.scale.unit
    }
    return {"bus": bus.name, "imitated_effects": sorted(set(imitated)), "devices": devices, "resolution": resolution}


def sentences(bus: Bus, readings: Mapping[str, Mapping[str, float]]) -> list[str]:
    """What acts, in words; empty when all is neutral."""
    found = []
    for name, values in readings.items():
        for row in settings(bus.nodes[name], values):
            if row["acts"]:
                what = f", which looks like {row['effect']}" if row["effect"] else ""
                unit = f" {row['unit']}" if row["unit"] else ""
                found.append(
                    f"{name}: {row['name']} ({row['object']}) is {row['value']:g}{unit}, "
                    f"not {row['neutral']:g}{unit}{what}"
                )
    return found


def _same(value: float, reading: Reading) -> bool:
    return reading.neutral is not None and math.isclose(
        value, reading.neutral, rel_tol=0.0, abs_tol=0.5 * abs(reading.scale.gain)
    )
