"""Excitation signals, one per file; the folder is the list.

A signal's name in plans (`kind`) is the name of its file. A file beside these that defines a `Signal` is a
new signal.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from functools import cache

from hydraulic_sysid.excitation.signals._base import Signal

__all__ = ["Signal", "signal_kinds"]


@cache
def signal_kinds() -> dict[str, type[Signal]]:
    """Every signal class by its name in plans, in alphabetical order."""
    kinds = {}
    for module_name in sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith("_")):
        module = importlib.import_module(f"{__name__}.{module_name}")
        for _, item in inspect.getmembers(module, inspect.isclass):
            if issubclass(item, Signal) and item.__module__ == module.__name__:
                kinds[module_name] = item
    return kinds
