"""Python text that is made at run time and compiled by numba: kept in a cache that is never stale.

The folder of a text is named after a hash of it, of everything that it calls, and of the versions of numba and Python:
whatever changes what is computed changes the folder.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import importlib.util
import os
import platform
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numba
from numba.core.errors import NumbaError

from hydraulic_node_utils.whole_file import write_text

CACHE_VARIABLE = "HYDRAULIC_SIM_CACHE"
_PATIENCE_S = 120.0  # with another process that compiles the same
_LOOK_S = 0.05


def cache_root() -> Path:
    """Where compiled code is kept: $HYDRAULIC_SIM_CACHE, or hydraulic_sim in the user's cache folder.

    Where that cannot be written to, a folder of the user's own among the temporary files.
    """
    named = os.environ.get(CACHE_VARIABLE)
    if named:
        return Path(named)
    home = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
    root = Path(home) / "hydraulic_sim"
    try:
        root.mkdir(parents=True, exist_ok=True)
        return root if os.access(root, os.W_OK) else temporary_root()
    except OSError:
        return temporary_root()


@lru_cache(maxsize=1)
def temporary_root() -> Path:
    """A folder of the user's own among the temporary files, the same for the whole process."""
    # What lies there is executed: it must be nobody else's, who may have taken the name.
    root = Path(tempfile.gettempdir()) / f"hydraulic_sim-{os.getuid()}"
    try:
        root.mkdir(mode=0o700, exist_ok=True)
        found = root.lstat()
        if found.st_uid == os.getuid() and stat.S_ISDIR(found.st_mode) and not found.st_mode & 0o022:
            return root
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="hydraulic_sim-"))


def place(stem: str, text: str, rests_on: Iterable[str]) -> Path:
    """The file of a text in the cache; arguments as of `load`."""
    digest = hashlib.sha256()
    for part in (text, *rests_on, numba.__version__, platform.python_version()):
        digest.update(part.encode())
    key = digest.hexdigest()[:20]
    return cache_root() / key / f"{stem}_{key}.py"


def load(stem: str, text: str, rests_on: Iterable[str], functions: Mapping[str, Callable]) -> ModuleType:
    """The module that ``text`` defines; compiled code of it is found again by later processes.

    :param stem: what the module's name begins with
    :param rests_on: texts of what it calls
    :param functions: what it finds under the name FUNCTIONS
    :raises NumbaError: it does not compile.
    """
    file = place(stem, text, rests_on)
    try:
        return _execute(file, text, functions)
    except NumbaError:
        raise
    except Exception:  # a cache that another version or a crash left unreadable is worth one clean attempt
        _set_aside(file.parent)
    return _execute(file, text, functions)


def _set_aside(folder: Path) -> None:
    """Remove a cache folder under another name: a process that compiles into it at this moment is not disturbed."""
    aside = folder.with_name(f".{folder.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        os.replace(folder, aside)
    shutil.rmtree(aside, ignore_errors=True)


def _execute(file: Path, text: str, functions: Mapping[str, Callable]) -> ModuleType:
    if not file.is_file() or file.read_bytes() != text.encode():  # a power cut can leave an empty file
        write_text(file, text)  # whole: two processes may compile the same text at the same time
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__["FUNCTIONS"] = dict(functions)
    sys.modules[spec.name] = module  # numba finds cached code again by the module's name
    with _alone(file.parent):
        spec.loader.exec_module(module)
    return module


@contextlib.contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """While no other process compiles into this folder, so that what several need at once is compiled by one of them.

    Where files cannot be locked, or the other one takes very long, without waiting.
    """
    with contextlib.ExitStack() as opened:
        with contextlib.suppress(OSError):
            lock = opened.enter_context((folder / "lock").open("w"))
            until = time.monotonic() + _PATIENCE_S
            while time.monotonic() < until:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    time.sleep(_LOOK_S)
        yield
