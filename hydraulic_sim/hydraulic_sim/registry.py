"""Finds effects: every file of `effects/`, and files of the user's own."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import ModuleType

from . import base, effects, slots
from .effect import Effect, Parameter, arguments
from .errors import EffectError


class Library(Mapping[str, Effect]):
    """Effects by name, in a fixed order (by slot, order and name), with the sources they came from."""

    def __init__(self, found: Iterable[tuple[Effect, Path]]) -> None:
        entries = list(found)
        self._sources: dict[str, Path] = {}
        for effect, path in entries:
            if effect.name in self._sources:
                raise EffectError(
                    f"{path}: an effect named {effect.name!r} is already defined in {self._sources[effect.name]}"
                )
            self._sources[effect.name] = path
        position = {name: i for i, name in enumerate(slots.SLOTS)}
        ordered = sorted((e for e, _ in entries), key=lambda e: (position[e.slot], e.order, e.name))
        self._effects = {e.name: e for e in ordered}
        for effect in ordered:
            _check(effect, self._sources[effect.name], self)

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
        return self._sources[name]

    def parameter(self, key: str) -> Parameter:
        """The parameter behind a key: ``moving_mass`` or ``coulomb_friction.force``. Raises `EffectError`."""
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
        """A hash over the text of every effect file, so that compiled physics is never stale."""
        digest = hashlib.sha256()
        for name in self:
            digest.update(name.encode())
            digest.update(self._sources[name].read_bytes())
        return digest.hexdigest()

    def with_files(self, files: Iterable[str | Path]) -> Library:
        """This library and the effects of the given files. Raises `EffectError`."""
        paths = [Path(f) for f in files]
        if not paths:
            return self
        mine = [(self[name], self._sources[name]) for name in self]
        return Library(mine + [load_effect(path) for path in paths])


def load_effect(path: Path) -> tuple[Effect, Path]:
    """Read one effect file; its name is the file's. Raises `EffectError`, naming the file."""
    path = path.expanduser().resolve()
    if not path.is_file():
        raise EffectError(f"{path}: there is no such effect file")
    place = hashlib.sha256(str(path).encode()).hexdigest()[:12]
    spec = importlib.util.spec_from_file_location(f"hydraulic_sim_user_effect_{place}_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise EffectError(f"{path}: not a Python file (an effect file ends in .py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise EffectError(f"{path}: {type(error).__name__}: {error}") from error
    return _named(module, path), path


def _named(module: ModuleType, path: Path) -> Effect:
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise EffectError(f"{path}: defines no module constant EFFECT of type Effect")
    return replace(effect, name=path.stem)


def _builtin() -> Iterator[tuple[Effect, Path]]:
    for info in pkgutil.iter_modules(effects.__path__):
        module = importlib.import_module(f"{effects.__name__}.{info.name}")
        path = Path(str(module.__file__))
        yield _named(module, path), path


_BUILTIN: list[Library] = []


def library(user_files: Iterable[str | Path] = ()) -> Library:
    """The built-in effects, and those of ``user_files``."""
    if not _BUILTIN:
        _BUILTIN.append(Library(_builtin()))
    return _BUILTIN[0].with_files(user_files)


def _check(effect: Effect, path: Path, found: Library) -> None:
    if effect.slot not in slots.SLOTS:
        raise EffectError(f"{path}: slot {effect.slot!r} does not exist; slots: {', '.join(slots.SLOTS)}")
    own = {p.name for p in effect.parameters} | {s.name for s in effect.states}
    taken = own & (set(slots.SIGNALS) | set(slots.PER_SAMPLE) | {p.name for p in base.PARAMETERS})
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
                or (slot.per_sample and which == "kernel" and argument in slots.PER_SAMPLE)
                or argument in {p.name for p in base.PARAMETERS}
            ):
                known = [s for s in slots.SIGNALS if slots.known_at(stage, s)]
                raise EffectError(
                    f"{path}: {which} asks for {argument!r}, which is not known in slot {effect.slot!r}; signals known "
                    f"there: {', '.join(known)}"
                )
