"""Compilation of the few loops that cannot be written as array operations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit


def jit(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function compiled, and kept compiled on disk where there is a place that can be written to.

    For functions that call no compiled function of another file: the cache would not see that one change.
    """
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:  # numba finds no folder for its cache
        return njit(nogil=True)(function)
