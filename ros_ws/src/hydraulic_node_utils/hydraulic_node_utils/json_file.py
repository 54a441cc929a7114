"""JSON files that a user names, and JSON in texts that anybody may send."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_node_utils.whole_file import write_text


def read_json(path: Path, error: type[HydraulicError]) -> Any:
    """What a JSON file holds.

    :raises error: it cannot be read, or holds no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise error(f"{path}: cannot be read ({problem.strerror})") from problem
    except (ValueError, RecursionError) as problem:
        raise error(f"{path}: not a JSON document ({problem})") from problem


def json_object(text: str | bytes) -> dict[str, Any]:
    """The JSON object in a text that came over a topic; empty where it holds none: anybody may publish anything."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


class NewJson:
    """A JSON file that a node is to write at the end of a run, named at its start; what is there is never replaced.

    :raises error: something is at ``path`` already. An empty ``path`` is no file, and `write` does nothing.
    """

    def __init__(self, path: str, error: type[HydraulicError]) -> None:
        self._path = Path(path).expanduser() if path else None
        self._error = error
        self.check()

    def check(self) -> None:
        """To be called before a run: may the file be written?

        :raises error: something is there, or the path names no file.
        """
        path = self._path
        if path is None:
            return
        if path.exists() or path.is_symlink():
            raise self._error(f"output: {path} exists and is not replaced; name another file")
        if not path.name:
            raise self._error(f"output: {path} names no file")

    def write(self, document: Any) -> None:
        """Create the file, whole.

        :raises error: it cannot be written, or something has come there meanwhile.
        """
        if self._path is None:
            return
        try:
            write_text(self._path, json.dumps(document) + "\n", overwrite=False)
        except OSError as problem:
            raise self._error(f"output: {self._path}: cannot be written ({problem.strerror})") from problem
