"""What a simulation returns, and the states between which it runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from .arrays import Array


@dataclass(frozen=True)
class Trajectory:
    """A simulated record; every array is (N,), sample k being the state at ``time[k]``, just as the drive changes.

    ``position`` [m], ``pressure_a``, ``pressure_b`` [Pa] are what the sensors say, the ``true_`` ones the states;
    ``velocity`` [m/s], ``pressure_supply`` [Pa], ``spool`` and ``opening`` (−1…1), ``force`` [N] from the pressures
    read, ``drive`` [V] as applied. ``final`` is the state after the last sample, to go on from.
    """

    time: Array
    drive: Array
    position: Array
    velocity: Array
    pressure_a: Array
    pressure_b: Array
    pressure_supply: Array
    spool: Array
    opening: Array
    force: Array
    true_position: Array
    true_pressure_a: Array
    true_pressure_b: Array
    final: PlantState

    def __getitem__(self, channel: str) -> Array:
        return getattr(self, channel)

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class PlantState:
    """States (n_states,), the effects' memories (n_memory,) and the time [s] since the start."""

    states: Array
    memory: Array
    time: float = 0.0


class PlantValues(NamedTuple):
    """One live sample: what the sensors say [m, m/s, Pa, Pa, Pa, -, N, V]."""

    position: float
    velocity: float
    pressure_a: float
    pressure_b: float
    pressure_supply: float
    spool: float
    force: float
    drive: float
