"""Memory of large arrays goes back to the system as soon as they do."""

from __future__ import annotations

import contextlib
import ctypes

_M_MMAP_THRESHOLD = -3  # mallopt(3)
_FROM = 4 << 20  # bytes


def give_back() -> None:
    """Have the C library take each array of 4 MiB and more from the system by itself.

    glibc raises that threshold to 32 MiB as a program goes on; then arrays of long records lie among small things that
    keep their memory. Other C libraries are left as they are.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, _FROM)
