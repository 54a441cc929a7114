"""A Python file of the user's own, run as a module that is named after its text."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from types import ModuleType


def run_file(path: Path, source: bytes, prefix: str) -> ModuleType:
    """The module that ``source``, read from ``path``, defines; anything it raises comes through.

    The text itself is executed, as the import system may take an edit within the same second for no edit. Its module is
    named after the text: compiled code, which is kept by the text and not by the place of the file, refers to the name.
    """
    module = ModuleType(f"{prefix}_{hashlib.sha256(source).hexdigest()[:12]}_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    exec(compile(source, str(path), "exec"), module.__dict__)
    return module
