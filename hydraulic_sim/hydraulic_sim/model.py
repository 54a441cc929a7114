"""A model: which effects are on, the value of every parameter, and what is known about it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from . import base, slots
from .effect import Parameter, arguments, check_value
from .errors import EffectError, ModelError
from .registry import Library, check_file, library

KINDS = ("hydraulic", "mechanical")


@dataclass(frozen=True)
class Entry:
    """One parameter of a model: value [SI], where it comes from, whether a fit may move it and how far.

    ``bounds`` [SI] lie within the library's; ``standard_error`` [SI] is there once fitted; ``printed`` keeps a
    value as a source prints it, where it is not the one used.
    """

    value: float
    source: str = ""
    free: bool | None = None
    bounds: tuple[float, float] | None = None
    standard_error: float | None = None
    printed: str | None = None
    note: str | None = None


@dataclass(frozen=True)
class Model:
    """A model as a user keeps it in a file. Immutable: the ``with_`` methods return changed copies.

    Keys are base parameters (``moving_mass``) and ``effect.parameter`` (``coulomb_friction.level``). A parameter
    without an entry has the library's default.
    """

    name: str
    entries: Mapping[str, Entry]
    effects: tuple[str, ...] = ()
    kind: str = "hydraulic"
    description: str = ""
    user_effects: tuple[Path, ...] = ()
    history: tuple[Mapping[str, object], ...] = ()
    path: Path | None = None
    document: object = field(default=None, compare=False, repr=False)
    lean: bool = False
    """Whether its library has, of the built-in effects, those alone that are on: it compiles faster."""

    @cached_property
    def library(self) -> Library:
        """The built-in effects and this model's own, as its files are when it is first asked for."""
        every = library(self.user_effects)
        return every.only([*self.effects, *(f.stem for f in self.user_effects)]) if self.lean else every

    def parameter(self, key: str) -> Parameter:
        """The library's record of a parameter.

        :raises ModelError: an unknown key.
        """
        try:
            return self.library.parameter(key)
        except EffectError as error:
            raise ModelError(f"{self._label}: {error}") from None

    def value(self, key: str) -> float:
        """The value of a parameter [SI]."""
        entry = self.entries.get(key)
        return self.parameter(key).default if entry is None else entry.value

    def entry(self, key: str) -> Entry:
        """What the model says about a parameter, defaults filled in from the library."""
        record = self.parameter(key)
        entry = self.entries.get(key) or Entry(record.default, source=f"library default: {record.source}")
        return replace(
            entry,
            free=record.free if entry.free is None else entry.free,
            bounds=record.bounds if entry.bounds is None else entry.bounds,
        )

    def keys(self) -> tuple[str, ...]:
        """Every parameter in use: base parameters of this kind of plant, and those of the effects that are on."""
        mechanical = self.kind == "mechanical"
        found = [p.name for p in base.PARAMETERS if not mechanical or p.name in base.MECHANICAL]
        active = set(self.effects)
        for effect in self.library.values():
            if effect.name in active or effect.always_on:
                found += [f"{effect.name}.{p.name}" for p in effect.parameters]
        return tuple(found)

    def free_keys(self) -> tuple[str, ...]:
        """The parameters that a fit may move."""
        return tuple(key for key in self.keys() if self.entry(key).free)

    def movable_keys(self) -> tuple[str, ...]:
        """What a fit may move: the free parameters, and those that only smooth the corner of a law."""
        movable = {*self.free_keys(), *self.nuisance_keys()}
        return tuple(key for key in self.keys() if key in movable)

    def nuisance_keys(self) -> tuple[str, ...]:
        """Parameters that only smooth the corner of a law which is on, unless the model calls them fixed."""
        laws = [self._effect(name) for name in self.effects]
        dry = any("direction" in arguments(f) for e in laws for f in e.functions().values())
        bristles = dry and not any(e.slot == "bristle" for e in laws)
        return tuple(
            key
            for key in self.keys()
            if self.parameter(key).nuisance
            and (bristles or not key.startswith("bristle_"))
            and not (key in self.entries and self.entries[key].free is not None)
        )

    def with_values(self, values: Mapping[str, float], *, source: str | None = None) -> Model:
        """A copy with other values [SI]. A value that changes takes ``source``, and loses the standard error.

        Bounds of an entry bind fits and files only.

        :raises ModelError: an unknown key or a value out of the library's bounds.
        """
        entries = dict(self.entries)
        for key, value in values.items():
            record = self.parameter(key)
            try:
                number = check_value(record, value, key)
            except EffectError as error:
                raise ModelError(f"{self._label}: {error}") from None
            old = entries.get(key, Entry(record.default, source=record.source))
            if number != old.value:
                old = replace(old, value=number, source="", standard_error=None)
            entries[key] = old if source is None else replace(old, source=source)
        return replace(self, entries=entries)

    def with_entry(self, key: str, **changes: object) -> Model:
        """A copy in which fields of one parameter's entry are changed (see `Entry`)."""
        record = self.parameter(key)
        old = self.entries.get(key) or Entry(record.default, source=record.source)
        return replace(self, entries={**self.entries, key: replace(old, **changes)})  # type: ignore[arg-type]

    def with_effect(self, name: str, values: Mapping[str, float] | None = None) -> Model:
        """A copy with an effect on, its parameters at the library's defaults unless given [SI]."""
        effect = self._effect(name)
        if effect.always_on:
            raise ModelError(f"{self._label}: {name} is base physics and always on")
        effects = self.effects if name in self.effects else (*self.effects, name)
        changed = replace(self, effects=effects).with_values({f"{name}.{k}": v for k, v in (values or {}).items()})
        changed.check_laws()
        return changed

    def with_effect_file(self, file: Path) -> Model:
        """A copy that has the effect of a file of the user's own in its library; it is off until `with_effect`.

        :raises EffectError: the file is unusable, or its name is taken.
        """
        file = file.expanduser().resolve()
        check_file(file)
        changed = self if file in self.user_effects else replace(self, user_effects=(*self.user_effects, file))
        assert changed.library
        return changed

    def with_moved_file(self, old: Path, new: Path) -> Model:
        """A copy that names an effect file at another place."""
        files = tuple(new.resolve() if file == old.resolve() else file for file in self.user_effects)
        return replace(self, user_effects=files)

    def without_effect(self, name: str) -> Model:
        """A copy with an effect off; what it said of the effect's parameters is kept out too."""
        if name not in self.effects:
            raise ModelError(f"{self._label}: {name} is not on; on are: {', '.join(self.effects) or 'none'}")
        entries = {k: v for k, v in self.entries.items() if not k.startswith(f"{name}.")}
        return replace(self, effects=tuple(e for e in self.effects if e != name), entries=entries)

    def with_history(self, **record: object) -> Model:
        """A copy with one more line of provenance."""
        return replace(self, history=(*self.history, record))

    def check_laws(self) -> None:
        """Check that the effects go together.

        :raises ModelError: two laws claim the same slot, or an effect is named twice.
        """
        taken: dict[str, str] = {}
        for name in self.effects:
            if self.effects.count(name) > 1:
                raise ModelError(f"{self._label}: the effect {name} is named twice")
            slot = self._effect(name).slot
            if slots.SLOTS[slot].kind == "law":
                if slot in taken:
                    raise ModelError(
                        f"{self._label}: {taken[slot]} and {name} are both laws of the slot {slot!r}; one at a time"
                    )
                taken[slot] = name

    def check_complete(self) -> None:
        """Check that the model composes.

        :raises ModelError: laws exclude each other, or values are missing.
        """
        if self.kind not in KINDS:
            raise ModelError(f"{self._label}: plant is {self.kind!r}; allowed: {', '.join(KINDS)}")
        self.check_laws()
        for name in self.effects:
            effect = self._effect(name)
            if self.kind == "mechanical" and slots.SLOTS[effect.slot].hydraulic:
                raise ModelError(f"{self._label}: {name} acts on the oil, which a mechanical plant does not have")
            if self.kind not in effect.kinds or (slots.SLOTS[effect.slot].mechanical and self.kind == "hydraulic"):
                raise ModelError(f"{self._label}: {name} is an effect of a mechanical plant; this one is {self.kind}")
        needed = [p.name for p in base.PARAMETERS if p.required]
        if self.kind == "mechanical":
            needed = ["moving_mass", "drive_force"]
        missing = [name for name in needed if name not in self.entries]
        if missing:
            raise ModelError(f"{self._label}: no value for {', '.join(missing)} (required for a {self.kind} plant)")

    def _effect(self, name: str):
        try:
            return self.library[name]
        except EffectError as error:
            raise ModelError(f"{self._label}: {error}") from None

    @property
    def _label(self) -> str:
        return str(self.path) if self.path else f"model {self.name!r}"


def check_bounds(key: str, record: Parameter, bounds: Iterable[float]) -> tuple[float, float]:
    """Bounds that a model file narrows: in order and within the library's.

    :raises ModelError: they are not.
    """
    low, high = (float(b) for b in bounds)
    if not record.bounds[0] <= low < high <= record.bounds[1]:
        raise ModelError(
            f"{key}: bounds [{low:g}, {high:g}] are not in order within {record.bounds[0]:g} … {record.bounds[1]:g} "
            f"{record.unit}"
        )
    return low, high


def check_within(key: str, record: Parameter, value: float, bounds: tuple[float, float] | None) -> None:
    """Check a value against the bounds that a model file gives for it.

    :raises ModelError: it lies outside.
    """
    if bounds is not None and not bounds[0] <= value <= bounds[1]:
        raise ModelError(
            f"{key}: {value:g} {record.unit} is outside its bounds {bounds[0]:g} … {bounds[1]:g} {record.unit}"
        )
