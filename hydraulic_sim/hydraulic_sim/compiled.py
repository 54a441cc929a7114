"""Compiles the text of a composition, and keeps the machine code in a cache that is never stale.

The text's folder is named after all that it rests on: itself, every effect file and the shared kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from numba import njit, types

from hydraulic_node_utils import generated_code

from . import kernels
from .acting import Acting
from .compose import Layout, write_module
from .errors import EffectError
from .registry import Library

_NUMBER, _BYTE = types.float64, types.uint8
_LINE, _TABLE = types.float64[::1], types.float64[:, ::1]
RUN = types.int64(
    _LINE, _NUMBER, _NUMBER, _TABLE, types.int64, _NUMBER, _NUMBER, _BYTE[::1], _LINE, _BYTE, _LINE, _LINE, _TABLE,
    _LINE,
)  # fmt: skip
"""The signature of `CompiledPlant.run`, the same for every library: compiled code can call it by a pointer."""


class CompiledPlant:
    """The compiled functions of one library (`rhs`, `run`, `run_many`, `prime`) and the layout of their arrays."""

    def __init__(self, library: Library) -> None:
        self.layout = Layout(library)
        self.module = _load(library)
        self.rhs: Callable = self.module.rhs
        self.run: Callable = self.module.run
        self.run_many: Callable = self.module.run_many
        self.prime: Callable = self.module.prime
        self._acting: dict[tuple[str, ...], Acting] = {}

    def acting(self, names: tuple[str, ...]) -> Acting:
        """What follows from these effects being on."""
        if names not in self._acting:
            self._acting[names] = Acting(self.layout, tuple(self.layout.library[name] for name in names))
        return self._acting[names]


def _load(library: Library) -> ModuleType:
    rests_on = (library.fingerprint, *(Path(f).read_text(encoding="utf-8") for f in (kernels.__file__, __file__)))
    functions = {
        f"{effect.name}.{which}": _inner(function)
        for effect in library.values()
        for which, function in effect.functions().items()
    }
    try:
        return generated_code.load("plant", write_module(library), rests_on, functions)
    except OSError:
        raise
    except Exception as error:
        raise EffectError(_complaint(library, error)) from error


@lru_cache(maxsize=512)
def _inner(function: Callable) -> Callable:
    """An effect's function, compiled once for all libraries that have it."""
    return njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, no_rewrites=True)(function)


def _complaint(library: Library, error: Exception) -> str:
    """What does not compile, and in which effect's file: numba's complaint, short of its way through the plant."""
    lines = [line.strip() for line in f"{error}".splitlines() if line.strip()]
    own = [str(library.source_file(name)) for name in library if not library.is_builtin(name)]
    place = next((line for line in lines for file in own if file in line), f"(in {' or '.join(own)})" if own else "")
    what = next((line for line in lines if not line.startswith("Failed in nopython")), type(error).__name__)
    return f"the effects do not compile: {what} {place}".strip()


_COMPILED: dict[str, CompiledPlant] = {}


def compiled(library: Library) -> CompiledPlant:
    """The compiled plant of a library, compiled at most once per process."""
    key = library.fingerprint
    if key not in _COMPILED:
        _COMPILED[key] = CompiledPlant(library)
    return _COMPILED[key]
