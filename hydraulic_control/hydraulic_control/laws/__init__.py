"""The control laws by name: every file of this folder with a constant LAW, and files of the user's own.

A law is one file. Those of the user are named in the environment variable `VARIABLE` (paths with a colon between),
which nodes and verbs read; they are Python, and naming one runs it.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType

from hydraulic_control.errors import ControlError
from hydraulic_control.law import Law
from hydraulic_control.law_parts import PARAMETERS
from hydraulic_node_utils.user_module import run_file

VARIABLE = "HYDRAULIC_LAWS"


@lru_cache(maxsize=1)
def laws() -> Mapping[str, Law]:
    """All laws by name, those of the package first; read once per process.

    :raises ControlError: a file of the user's is no law; the text names it.
    """
    found: dict[str, Law] = {}
    taken = {spec.name for spec in PARAMETERS}
    for name, module, place in (*_own(), *_named()):
        law = getattr(module, "LAW", None)
        if not isinstance(law, Law):
            raise ControlError(f"{place}: defines no constant LAW of type Law")
        if name in found:
            raise ControlError(f"{place}: there is a law {name!r} already")
        if twice := sorted(taken & {spec.name for spec in law.parameters}):
            raise ControlError(f"{place}: the parameters {twice} belong to others; name them {name}.…")
        taken |= {spec.name for spec in law.parameters}
        found[name] = replace(law, name=name)
    return found


def _own() -> Iterator[tuple[str, ModuleType, str]]:
    for info in pkgutil.iter_modules(__path__):
        if not info.name.startswith("_"):
            module = importlib.import_module(f"{__name__}.{info.name}")
            yield info.name, module, str(module.__file__)


def _named() -> Iterator[tuple[str, ModuleType, str]]:
    """The files that the user names: their text is executed, in a module named after it."""
    for text in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
        path = Path(text).expanduser().resolve()
        if path.suffix != ".py" or not path.stem.isidentifier() or not path.is_file():
            raise ControlError(f"{VARIABLE}: {text!r} is no Python file named as a law can be (name.py)")
        try:
            module = run_file(path, path.read_bytes(), "hydraulic_control_user_law")
        except (Exception, SystemExit) as error:
            raise ControlError(f"{path}: {type(error).__name__}: {error}") from error
        yield path.stem, module, str(path)
