"""Compiles the text of a composition, and keeps the machine code in a cache that is never stale.

The cache folder is named after a hash of the generated text, of every effect file, of the shared kernels and of the
versions of numba and Python: whatever changes the physics changes the folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import platform
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numba
from numba.core.errors import NumbaError

from hydraulic_node_utils.whole_file import write_text

from . import kernels
from .compose import Layout, write_module
from .errors import EffectError
from .registry import Library

CACHE_VARIABLE = "HYDRAULIC_SIM_CACHE"


class CompiledPlant:
    """The compiled functions of one library (`rhs`, `run`, `run_many`, `track`) and the layout of their arrays."""

    def __init__(self, library: Library) -> None:
        self.layout = Layout(library)
        self.module = _load(library)
        self.rhs: Callable = self.module.rhs
        self.run: Callable = self.module.run
        self.run_many: Callable = self.module.run_many
        self.track: Callable = self.module.track


def cache_root() -> Path:
    """Where compiled physics is kept: $HYDRAULIC_SIM_CACHE, or hydraulic_sim in the user's cache folder.

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


def _load(library: Library) -> ModuleType:
    text = write_module(library)
    digest = hashlib.sha256()
    for part in (
        text,
        library.fingerprint,
        *(Path(f).read_text(encoding="utf-8") for f in (kernels.__file__, __file__)),
        numba.__version__,
        platform.python_version(),
    ):
        digest.update(part.encode())
    key = digest.hexdigest()[:20]
    file = cache_root() / key / f"plant_{key}.py"
    try:
        return _execute(file, text, library)
    except NumbaError as error:
        raise EffectError(_complaint(library, error)) from error
    except Exception:  # a cache that another version or a crash left unreadable is worth one clean attempt
        _set_aside(file.parent)
    try:
        return _execute(file, text, library)
    except OSError:
        raise
    except Exception as error:
        raise EffectError(_complaint(library, error)) from error


def _set_aside(folder: Path) -> None:
    """Remove a cache folder under another name: a process that compiles into it at this moment is not disturbed."""
    aside = folder.with_name(f".{folder.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        os.replace(folder, aside)
    shutil.rmtree(aside, ignore_errors=True)


def _complaint(library: Library, error: Exception) -> str:
    """What does not compile, and in which effect's file: numba's complaint, short of its way through the plant."""
    lines = [line.strip() for line in f"{error}".splitlines() if line.strip()]
    own = [str(library.source_file(name)) for name in library if not library.is_builtin(name)]
    place = next((line for line in lines for file in own if file in line), f"(in {' or '.join(own)})" if own else "")
    what = next((line for line in lines if not line.startswith("Failed in nopython")), type(error).__name__)
    return f"the effects do not compile: {what} {place}".strip()


def _execute(file: Path, text: str, library: Library) -> ModuleType:
    if not file.is_file() or file.read_bytes() != text.encode():  # a power cut can leave an empty file
        write_text(file, text)  # whole: two processes may compile the same physics at the same time
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    module.__dict__["FUNCTIONS"] = {
        f"{effect.name}.{which}": function
        for effect in library.values()
        for which, function in effect.functions().items()
    }
    sys.modules[spec.name] = module  # numba finds cached code again by the module's name
    spec.loader.exec_module(module)
    return module


_COMPILED: dict[str, CompiledPlant] = {}


def compiled(library: Library) -> CompiledPlant:
    """The compiled plant of a library, compiled at most once per process."""
    key = library.fingerprint
    if key not in _COMPILED:
        _COMPILED[key] = CompiledPlant(library)
    return _COMPILED[key]
