"""How the last run of an actuator ended, kept on disk: a stop, or an end that nobody ordered, outlives its process."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from pathlib import Path

_EARLIER = "from before this start: "


def state_folder() -> Path:
    """Where the state of programs is kept by the XDG convention; of this one, in a folder of its own."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "hydraulic_bench"


class RunMarker:
    """A file that is there while an actuator is in use, and after a run that ended stopped or not in order.

    `hardware` names what the actuator hangs on; each has a file of its own.
    """

    def __init__(self, hardware: str, folder: Path | None = None) -> None:
        self._path = (folder or state_folder()) / f"{re.sub(r'[^A-Za-z0-9.-]+', '_', hardware)}.in_use"

    def begin(self) -> str:
        """Mark that a run begins; why it has to begin stopped, "" if it has not."""
        try:
            found = self._path.read_text(encoding="utf-8", errors="replace") if self._path.exists() else None
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._write("")
        except OSError as error:
            return f"how the last run ended cannot be known, {self._path}: {error.strerror or error}"
        if found is None:
            return ""
        return _EARLIER + (found.strip() or "the process ended without a word, its actuator in use")

    def end(self, stop_reason: str) -> None:
        """Mark that the run ended in order; a latched stop is kept for the next one."""
        # What cannot be written or removed is there, or cannot be known, at the next start: stopped in both cases.
        with suppress(OSError):
            if stop_reason:
                self._write(stop_reason.removeprefix(_EARLIER))
            else:
                self._path.unlink(missing_ok=True)

    def _write(self, text: str) -> None:
        with self._path.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        folder = os.open(self._path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)  # the name has to survive a loss of power as well
        finally:
            os.close(folder)
