"""The channels a record can have: names and SI units, the only list of them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """One channel: its SI unit as text that pint reads, and what it means."""

    unit: str
    meaning: str


CHANNELS: dict[str, Channel] = {
    "command": Channel("V", "drive that was asked for"),
    "drive": Channel("V", "drive that the servo amplifier applied, from its sample on"),
    "position": Channel("m", "piston position, 0 in the middle of the stroke"),
    "velocity": Channel("m/s", "piston velocity"),
    "spool": Channel("m", "spool position of the servo valve"),
    "force": Channel("N", "force of the pressures on the piston, or of the actuator"),
    "pressure_a": Channel("Pa", "pressure in chamber A"),
    "pressure_b": Channel("Pa", "pressure in chamber B"),
    "pressure_supply": Channel("Pa", "supply pressure"),
    "reference": Channel("m", "position that a controller was asked to follow"),
}

CHAMBERS = ("pressure_a", "pressure_b")
"""The pressures of the two chambers."""

TIME = "time"
TIME_UNIT = "s"

HELD = frozenset({"command", "drive", "reference"})
"""Channels that keep their value until the next one, and are not interpolated between samples."""


def si_unit(quantity: str) -> str:
    """SI unit of a channel or of "time"."""
    return TIME_UNIT if quantity == TIME else CHANNELS[quantity].unit


def allowed() -> str:
    """All channel names, for error texts."""
    return ", ".join(CHANNELS)
