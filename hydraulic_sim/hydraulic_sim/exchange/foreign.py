"""An FMU of anybody (FMI 2.0, co-simulation) run over a drive, by FMPy.

The drive is held over each sample, which is one communication step; outputs are read once the drive of their sample is
set, before it acts. Numbers are SI outside; the FMU's own units are those of its modelDescription.xml, SI where it
states none.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import os
import shutil
import tempfile
import threading
import weakref
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_interfaces.errors import one_line

from .. import base
from ..arrays import Array
from ..errors import ExchangeError, ModelError
from ..units import conversion
from .plant_source import INITIAL

DRIVE = "drive"
CHANNELS = {
    name: base.OUTPUT_UNITS[name]
    for name in ("position", "velocity", "pressure_a", "pressure_b", "pressure_supply", "spool")
}
"""Channels that an FMU can have as outputs, with the unit that they take here."""
PARAMETERS = {
    **{f"initial.{name}": base.OUTPUT_UNITS[name] for name in INITIAL},
    **{p.name: p.unit for p in base.PARAMETERS if p.name in ("piston_area_a", "piston_area_b", "spool_travel")},
}
"""Parameters of an FMU that a comparison uses where it has them."""
KEYS = {DRIVE: "V", **CHANNELS, **PARAMETERS}
_SHOWN, _LONGEST = 12, 300  # variables that a message lists, characters of a library's error in it


@dataclass(frozen=True)
class _Variable:
    reference: int
    factor: float
    offset: float
    start: float | None

    def own(self, value: float) -> float:
        """A value of SI in the FMU's unit."""
        return (value - self.offset) / self.factor


class ForeignFmu:
    """An FMU with the names under which it has what the bench knows (`KEYS`; its own where they are the same).

    :raises ExchangeError: no FMU that can be run here, or one without drive or position; names what it has.
    """

    def __init__(self, path: Path, names: Mapping[str, str] | None = None) -> None:
        import fmpy  # takes long to import

        self.path = path
        try:
            self._known = fmpy.read_model_description(str(path))
        except Exception as error:  # FMPy raises whatever its parsers do
            raise ExchangeError(f"{path}: no FMU that can be read ({one_line(error, _LONGEST)})") from None
        if self._known.fmiVersion != "2.0" or self._known.coSimulation is None:
            kind = "model exchange alone" if self._known.coSimulation is None else f"FMI {self._known.fmiVersion}"
            raise ExchangeError(f"{path}: is of {kind}; FMI 2.0 for co-simulation can be run")
        self.name = str(self._known.modelName)
        self.description = str(self._known.description or "")
        self.tool = str(self._known.generationTool or "")
        self._variables = self._found(names or {})
        for needed in (DRIVE, "position"):
            if needed not in self._variables:
                raise ExchangeError(
                    f"{path}: no variable is called {needed!r}; say which one it is (--variables {needed}=NAME): "
                    f"{self._listed('input' if needed == DRIVE else 'output')}"
                )
        self._folder = tempfile.mkdtemp(prefix="hydraulic-fmu-")
        weakref.finalize(self, shutil.rmtree, self._folder, True)
        try:
            fmpy.extract(str(path), unzipdir=self._folder)
        except Exception as error:
            raise ExchangeError(f"{path}: cannot be unpacked ({one_line(error, _LONGEST)})") from None

    def _found(self, names: Mapping[str, str]) -> dict[str, _Variable]:
        unknown = sorted(set(names) - set(KEYS))
        if unknown:
            raise ExchangeError(f"no variable of an FMU can stand for {unknown[0]!r}; allowed: {', '.join(KEYS)}")
        by_name = {v.name: v for v in self._known.modelVariables}
        found = {}
        for key, si in KEYS.items():
            name = names.get(key, key)
            variable = by_name.get(name)
            if variable is None:
                if key in names:
                    raise ExchangeError(f"{self.path}: has no variable {name!r} for {key}; it has {self._listed()}")
                continue
            if variable.type != "Real":
                raise ExchangeError(f"{self.path}: {name} is of the type {variable.type}; {key} must be Real")
            unit = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
            try:
                factor, offset = conversion(unit, si, f"{self.path}: {name}") if unit else (1.0, 0.0)
            except ModelError as error:
                raise ExchangeError(f"{error}; {key} is in {si}") from None
            start = None if variable.start is None else factor * float(variable.start) + offset
            found[key] = _Variable(int(variable.valueReference), factor, offset, start)
        return found

    def _listed(self, causality: str | None = None) -> str:
        names = [v.name for v in self._known.modelVariables if causality is None or v.causality == causality]
        more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
        return (", ".join(names[:_SHOWN]) or "nothing") + more

    @property
    def channels(self) -> tuple[str, ...]:
        """Which of `CHANNELS` it has."""
        return tuple(name for name in CHANNELS if name in self._variables)

    def settable(self, name: str) -> bool:
        """Whether it has that one of `PARAMETERS`."""
        return name in self._variables

    def parameter(self, name: str) -> float | None:
        """Start value [SI] of one of `PARAMETERS`; None where it has none."""
        return self._variables[name].start if name in self._variables else None

    def simulate(self, drive: ArrayLike, dt: float, initial: Mapping[str, float] | None = None) -> dict[str, Array]:
        """Channels ``(N,)`` [SI] over ``drive`` (N,) [V], from ``initial`` values (of `PARAMETERS`, those it has).

        :raises ExchangeError: the FMU refuses a value or a step, or gives what is not finite; with its own words.
        """
        name = f"{self.name}-{next(_NUMBERS)}"
        said = _SAID[name] = []
        given = {k: v for k, v in (initial or {}).items() if k in self._variables}
        try:
            with _ONE_AT_A_TIME, _same_folder():
                found = self._run(name, np.asarray(drive, dtype=float), dt, given)
        except Exception as error:  # FMPy's own, and what the system says of a library that cannot be loaded
            raise ExchangeError(f"{self.path}: the FMU fails ({one_line(error, _LONGEST)}){_told(said)}") from None
        finally:
            del _SAID[name]
        if not np.isfinite(found).all():
            k, i = np.argwhere(~np.isfinite(found))[0]
            raise ExchangeError(f"{self.path}: {self.channels[i]} is not finite at {k * dt:g} s")
        which = [self._variables[n] for n in self.channels]
        return {n: found[:, i] * v.factor + v.offset for i, (n, v) in enumerate(zip(self.channels, which, strict=True))}

    def _run(self, name: str, drive: Array, dt: float, initial: Mapping[str, float]) -> Array:
        from fmpy.fmi2 import FMU2Slave

        unit = FMU2Slave(
            guid=self._known.guid,
            unzipDirectory=self._folder,
            instanceName=name,
            modelIdentifier=self._known.coSimulation.modelIdentifier,
        )
        unit.instantiate(callbacks=_callbacks())
        try:
            unit.setupExperiment(startTime=0.0)
            for key, value in initial.items():
                unit.setReal([self._variables[key].reference], [self._variables[key].own(value)])
            unit.enterInitializationMode()
            volts = self._variables[DRIVE]
            u = (drive - volts.offset) / volts.factor
            unit.setReal([volts.reference], [float(u[0])])
            unit.exitInitializationMode()
            found = self._stepped(unit, u, dt, volts.reference)
            unit.terminate()
            return found
        finally:
            unit.freeInstance()

    def _stepped(self, unit: Any, u: Array, dt: float, drive: int) -> Array:
        references: Sequence[int] = [self._variables[n].reference for n in self.channels]
        n = len(references)
        row, held = (ctypes.c_double * n)(), (ctypes.c_double * 1)()
        outputs, drives = (ctypes.c_uint * n)(*references), (ctypes.c_uint * 1)(drive)
        found = np.empty((len(u), n))
        for k in range(len(u)):
            held[0] = u[k]
            unit.fmi2SetReal(unit.component, drives, 1, held)
            unit.fmi2GetReal(unit.component, outputs, n, row)
            found[k] = row
            unit.fmi2DoStep(unit.component, k * dt, dt, 0)
        return found


_SAID: dict[str, list[str]] = {}
"""What each running FMU, by its instance's name, has said."""
_NUMBERS = itertools.count()
_ONE_AT_A_TIME = threading.Lock()
"""FMUs of others need not bear threads, and FMPy changes the working folder while it loads one."""


@contextlib.contextmanager
def _same_folder() -> Iterator[None]:
    """Go back to the working folder, which FMPy leaves where a library cannot be loaded."""
    before = os.getcwd()
    try:
        yield
    finally:
        os.chdir(before)


def _log(_environment: Any, name: bytes | None, _status: int, _category: bytes, message: bytes | None) -> None:
    text = (message or b"").decode(errors="replace")
    _SAID.get((name or b"").decode(errors="replace"), []).append(text)


@cache
def _callbacks() -> Any:
    """FMI's callbacks, one for the whole process: FMPy's helper that fills in a message's values knows one logger."""
    from fmpy import calloc, free
    from fmpy.fmi2 import (
        fmi2CallbackAllocateMemoryTYPE,
        fmi2CallbackFreeMemoryTYPE,
        fmi2CallbackFunctions,
        fmi2CallbackLoggerTYPE,
    )

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(_log)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    with contextlib.suppress(ImportError, OSError):  # not for this platform: messages keep their places for values
        from fmpy.logging import addLoggerProxy

        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


def _told(said: list[str]) -> str:
    return f"; it says: {' / '.join(said[-3:])}" if said else ""
