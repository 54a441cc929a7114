"""What travels over the contract's topics, as plain data in SI units, free of ROS.

Stamps are nanoseconds since the epoch of the clock in use (wall time, or simulated time on `/clock`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

NAN = math.nan


@dataclass(frozen=True, slots=True)
class Command:
    """What a source asks of the servo amplifier: `drive` [V] at `stamp_ns`, from the source of that name."""

    stamp_ns: int
    source: str
    drive: float


@dataclass(frozen=True, slots=True)
class PlantSample:
    """What the sensors say at one sampling instant, and the drive applied from that instant on.

    `position` [m] with 0 in mid-stroke, `velocity` [m/s], `force` [N] as the pressures give it, `drive` [V],
    `spool` [m], pressures [Pa]. A quantity the bench does not measure is NaN.
    """

    stamp_ns: int
    position: float
    velocity: float = NAN
    force: float = NAN
    drive: float = 0.0
    spool: float = NAN
    pressure_a: float = NAN
    pressure_b: float = NAN
    pressure_supply: float = NAN
    limit_retracted: bool = False
    limit_extended: bool = False


@dataclass(frozen=True, slots=True)
class Reference:
    """What the controller follows: `position` [m] and `velocity` [m/s] of the piston at `stamp_ns`."""

    stamp_ns: int
    position: float
    velocity: float = NAN
