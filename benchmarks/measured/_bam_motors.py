"""The three motors whose logs BAM published: which logs are for fitting, and what each log states of the machine."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from measured._bam import GRAVITY, Log


@dataclass(frozen=True)
class Motor:
    """One motor. ``fitted``: whether a log is for fitting; the others are test data that no fit has seen."""

    name: str
    title: str
    columns: str
    folder: str
    split: str
    fitted: Callable[[Log], bool]
    settings: Callable[[Log], dict[str, float]]
    held: bool = True
    """Whether the goal is held until the next, as column map and model have it."""


def _gain(log: Log) -> dict[str, float]:
    return {"position_loop.firmware_gain": log.kp}


def _go1(log: Log) -> dict[str, float]:
    return {
        **_gain(log),
        "payload.mass": (log.mass + log.arm_mass / 3.0) * log.length**2,
        "gravity_pendulum.weight": (log.mass + 0.5 * log.arm_mass) * GRAVITY * log.length,
    }


MOTORS = {
    m.name: m
    for m in (
        Motor("xl330", "Dynamixel XL330", "bam_pendulum", "bam/data.bak/raw", "fitted at firmware gains 100 and 400, "
              "tested at 200 and 800", lambda log: log.kp in (100.0, 400.0), _gain),
        Motor("sts3250", "Feetech STS3250", "bam_pendulum", "data_raw_feetech", "fitted to the trajectories "
              "sin_time_square and lift_and_drop, tested on sin_sin and up_and_down",
              lambda log: log.trajectory in ("sin_time_square", "lift_and_drop"), _gain),
        Motor("go1", "Unitree Go1", "bam_go1", "example_data/data_raw_go1", "fitted with 1 and 3 kg, tested with 0 and "
              "2 kg", lambda log: log.mass in (1.0, 3.0), _go1, held=False),
    )
}  # fmt: skip
