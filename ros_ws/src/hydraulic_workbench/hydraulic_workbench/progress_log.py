"""What a verb says while it runs: lines of JSON among what it prints, read from its log as it grows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hydraulic_node_utils.json_file import json_object

_MOST = 1 << 20  # bytes of one look


class ProgressLog:
    """Follows a log; `news` gives the objects that have come since the last look."""

    def __init__(self, file: Path) -> None:
        self._file, self._offset, self._rest = file, 0, b""

    def news(self) -> list[dict[str, Any]]:
        """Objects of whole lines; what is no JSON object is passed over."""
        try:
            with self._file.open("rb") as stream:
                stream.seek(self._offset)
                text = stream.read(_MOST)
        except OSError:
            return []
        self._offset += len(text)
        *lines, self._rest = (self._rest + text).split(b"\n")
        return [found for line in lines if line.startswith(b"{") and (found := json_object(line))]

    def words(self, most: int = 12) -> str:
        """The last lines that are meant for people."""
        try:
            lines = self._file.read_text("utf-8", errors="replace").splitlines()
        except OSError:
            return ""
        return "\n".join([line for line in lines if not line.startswith('{"')][-most:])
