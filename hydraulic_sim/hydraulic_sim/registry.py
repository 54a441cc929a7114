"""Finds effects: every file of `effects/`, and files of the user's own."""

from __future__ import annotations

import hashlib
import importlib
import pkgutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from hydraulic_node_utils.user_module import run_file

from . import base, effects, slots
from .effect import Effect, Parameter, arguments
from .effect_check import check_effect
from .errors import EffectError


class EffectFile(NamedTuple):
    """An effect, the file that defines it, and a hash of the text that was read from it."""

    effect: Effect
    path: Path
    digest: str


class Library(Mapping[str, Effect]):
    """Effects by name, in a fixed order (by slot, order and name), with the sources they came from."""

    def __init__(self, files: Iterable[EffectFile]) -> None:
        self._files: dict[str, EffectFile] = {}
        for entry in files:
            effect, path, _ = entry
            if effect.name in self._files:
                raise EffectError(
                    f"{path}: an effect named {effect.name!r} is already defined in {self._files[effect.name].path}"
                )
            _check_slot(effect, path)
            self._files[effect.name] = entry
        position = {name: i for i, name in enumerate(slots.SLOTS)}
        ordered = sorted((e.effect for e in self._files.values()), key=lambda e: (position[e.slot], e.order, e.name))
        self._effects = {e.name: e for e in ordered}
        self._extended: dict[tuple[tuple[Path, str], ...], Library] = {}
        for effect in ordered:
            _check(effect, self._files[effect.name].path, self)

    def __getitem__(self, name: str) -> Effect:
        try:
            return self._effects[name]
        except KeyError:
            raise EffectError(f"unknown effect {name!r}; the library has: {', '.join(sorted(self))}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def __contains__(self, name: object) -> bool:
        return name in self._effects

    def source_file(self, name: str) -> Path:
        """The file that defines the effect."""
        return self.file(name).path

    def is_builtin(self, name: str) -> bool:
        """Whether the effect ships with the package."""
        return str(self.source_file(name).parent) in effects.__path__

    def file(self, name: str) -> EffectFile:
        """The effect with its file and the hash of its text.

        :raises EffectError: an unknown name.
        """
        return EffectFile(self[name], *self._files[name][1:])

    def parameter(self, key: str) -> Parameter:
        """The parameter behind a key: ``moving_mass`` or ``coulomb_friction.force``.

        :raises EffectError: an unknown effect or parameter.
        """
        owner, _, name = key.rpartition(".")
        group = self[owner].parameters if owner else base.PARAMETERS
        for parameter in group:
            if parameter.name == name:
                return parameter
        allowed = ", ".join(p.name for p in group)
        where = f"effect {owner!r}" if owner else "the base physics"
        raise EffectError(f"{where} has no parameter {name!r}; it has: {allowed}")

    @cached_property
    def fingerprint(self) -> str:
        """A hash over the text that every effect was read from, so that compiled physics is never stale."""
        return _digest("".join(f"{name} {self._files[name].digest}\n" for name in self).encode())

    def only(self, names: Iterable[str]) -> Library:
        """These effects, those that are always on, and those whose parameters any of them uses: fewer compile faster.

        :raises EffectError: an unknown name.
        """
        wanted, queue = set[str](), [*names, *(name for name in self if self[name].always_on)]
        while queue:
            name = queue.pop()
            if name not in wanted:
                wanted.add(name)
                queue += [owner for key in self[name].uses.values() if (owner := key.rpartition(".")[0])]
        return Library(map(self.file, wanted))

    def with_files(self, files: Iterable[str | Path]) -> Library:
        """This library and the effects of the given files.

        :raises EffectError: a file is unusable, or its name is taken.
        """
        added = tuple(load_effect(Path(f)) for f in files)
        if not added:
            return self
        key = tuple((f.path, f.digest) for f in added)
        if key not in self._extended:
            extended = Library((*self._files.values(), *added))
            for entry in added:
                check_effect(entry.effect, entry.path)
            self._extended[key] = extended
        return self._extended[key]


def load_effect(path: Path) -> EffectFile:
    """Read one effect file; its name is the file's.

    :raises EffectError: it is no effect file; the text names it.
    """
    path = path.expanduser().resolve()
    check_file(path)
    source = path.read_bytes()
    return EffectFile(_executed(path, source), path, _digest(source))


def check_file(path: Path) -> None:
    """Check what can be said of an effect file without running it.

    :raises EffectError: it is not there, or its name cannot be an effect's.
    """
    try:
        there = path.is_file()
    except OSError as error:
        raise EffectError(f"{str(path)[:200]}: an effect file with this name cannot be: {error.strerror}") from None
    if not there:
        raise EffectError(f"{path}: there is no such effect file")
    if path.suffix != ".py":
        raise EffectError(f"{path}: an effect file is Python and ends in .py")
    if not path.stem.isidentifier():
        raise EffectError(f"{path}: an effect is named after its file, and {path.stem!r} is not a Python identifier")


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@lru_cache(maxsize=256)
def _executed(path: Path, source: bytes) -> Effect:
    """The effect that ``source`` defines."""
    try:
        module = run_file(path, source, "hydraulic_sim_user_effect")
    except (Exception, SystemExit) as error:
        raise EffectError(f"{path}: {type(error).__name__}: {error}") from error
    return _named(module, path)


def _named(module: ModuleType, path: Path) -> Effect:
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise EffectError(f"{path}: defines no module constant EFFECT of type Effect")
    return replace(effect, name=path.stem)


def _builtin() -> Iterator[EffectFile]:
    for info in pkgutil.iter_modules(effects.__path__):
        module = importlib.import_module(f"{effects.__name__}.{info.name}")
        path = Path(str(module.__file__))
        yield EffectFile(_named(module, path), path, _digest(path.read_bytes()))


_BUILTIN: list[Library] = []


def library(user_files: Iterable[str | Path] = ()) -> Library:
    """The built-in effects, and those of ``user_files``."""
    if not _BUILTIN:
        _BUILTIN.append(Library(_builtin()))
    return _BUILTIN[0].with_files(user_files)


def _check_slot(effect: Effect, path: Path) -> None:
    if effect.slot not in slots.SLOTS:
        raise EffectError(f"{path}: slot {effect.slot!r} does not exist; slots: {', '.join(slots.SLOTS)}")
    if effect.memory and not slots.SLOTS[effect.slot].per_sample:
        allowed = ", ".join(name for name, slot in slots.SLOTS.items() if slot.per_sample)
        raise EffectError(f"{path}: slot {effect.slot!r} is no place for a memory; memories are kept in: {allowed}")
    if effect.states and effect.slot == "command":
        raise EffectError(f"{path}: an effect on the command is evaluated once per sample and cannot have states")


def _check(effect: Effect, path: Path, found: Library) -> None:
    own = {p.name for p in effect.parameters} | {s.name for s in effect.states}
    taken = own & (set(slots.SIGNALS) | {*slots.PER_SAMPLE, *slots.OF_COMMAND} | {p.name for p in base.PARAMETERS})
    if taken:
        raise EffectError(f"{path}: the names {sorted(taken)} belong to signals or base parameters")
    for alias, key in effect.uses.items():
        try:
            found.parameter(key)
        except EffectError as error:
            raise EffectError(f"{path}: input {alias!r}: {error}") from None
    slot = slots.SLOTS[effect.slot]
    for which, function in effect.functions().items():
        stage = effect.slot if which == "kernel" else "dynamics"
        for argument in arguments(function):
            if not (
                argument in own
                or argument in effect.uses
                or slots.known_at(stage, argument)
                or (which == "kernel" and slot.kind == "chain" and argument in slot.returns)
                or (slot.per_sample and which == "kernel" and argument == "dt")
                or (effect.slot == "command" and which == "kernel" and argument in slots.OF_COMMAND)
                or (effect.memory and which == "kernel" and argument == "memory")
                or argument in {p.name for p in base.PARAMETERS}
            ):
                known = [s for s in slots.SIGNALS if slots.known_at(stage, s)]
                raise EffectError(
                    f"{path}: {which} asks for {argument!r}, which is not known in slot {effect.slot!r}; signals known "
                    f"there: {', '.join(known)}; own: {', '.join(sorted(own)) or 'none'}; memory: {effect.memory}"
                )
