"""What follows from which effects are on, whatever their values: worked out once for all plants that have them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from .arrays import Array, Index
from .compose import Layout
from .effect import Effect, arguments
from .slots import OF_COMMAND, PER_SAMPLE, SLOTS

STOPS = "end_stop"
_OF_FORCES = ("moving_mass", "drive_force", "bristle_length", "bristle_time")  # base parameters of forces alone


@dataclass(frozen=True)
class Followed:
    """What a propagation follows from: effects by their ``names``, and the ``places`` of values in the parameters."""

    names: tuple[str, ...]
    places: Index

    @classmethod
    def of(cls, layout: Layout, effects: Sequence[Effect], base_keys: Iterable[str]) -> Followed:
        """Base parameters and all those of some effects."""
        keys = [*base_keys, *(f"{e.name}.{p.name}" for e in effects for p in e.parameters)]
        places = np.array([layout.parameters[key] for key in keys], dtype=np.int64)
        return cls(tuple(e.name for e in effects), places)

    def path(self, parameters: Array) -> tuple[float | str, ...]:
        """The names, and the values at the places."""
        return (*self.names, *parameters[self.places].tolist())


class Acting:
    """The ``effects`` that are on in a layout's plant, and what is so whatever their values."""

    def __init__(self, layout: Layout, effects: tuple[Effect, ...]) -> None:
        self.effects = effects
        self.but_stops = tuple(e for e in effects if e.name != STOPS)
        self.inner = tuple(e for e in effects if e.states or e.slot == "command")
        """Those with states of their own, or that remember the command."""
        lasting = [e for e in effects if e.memory and e.reach is None and not e.slot.endswith("_sensor")]
        every = range(layout.n_memory)
        self.lasting_memories = [k for e in lasting for k in every[layout.memories[e.name]]]
        self.has_inner_states = any(e.states for e in effects) or bool(self.lasting_memories)
        self.begins_shown = any(e.begins_shown for e in effects)
        self.remembers = any(e.slot == "command" for e in effects)
        self.closes_a_loop = any(e.slot == "loop" for e in effects)
        self.follows_the_drive_alone = not self.closes_a_loop and all(map(_follows_the_drive, self.inner))
        own = [k for k in layout.parameters if "." not in k]
        moving = [e for e in effects if SLOTS[e.slot].subsystem != "sensor"]
        flowing = [e for e in moving if SLOTS[e.slot].subsystem != "force"]
        self.motion = Followed.of(layout, moving, own)
        self.held = Followed.of(layout, flowing, (k for k in own if k not in _OF_FORCES))
        self.memory = Followed.of(layout, self.inner, ["drive_limit"])


def _follows_the_drive(effect: Effect) -> bool:
    """Whether an effect's states or memory follow from the drive alone, not from the motion."""
    own = {p.name for p in effect.parameters} | {s.name for s in effect.states}
    taken = set(arguments(effect.dynamics or effect.kernel)) - own
    return taken <= {"command", "t", *PER_SAMPLE, *OF_COMMAND}
