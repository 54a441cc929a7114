"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def write_text(path: Path, content: str | bytes, *, overwrite: bool = True) -> None:
    """Write a file: into a neighbour first, then under its own name. Its folder is made where there is none.

    :raises FileExistsError: it exists and is not to be replaced.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, draft = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.absolute().parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content.encode() if isinstance(content, str) else content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(draft, 0o644)
        # Unlike a rename, a link never takes the place of a file that has come meanwhile.
        (os.replace if overwrite else os.link)(draft, path)
    finally:
        Path(draft).unlink(missing_ok=True)
