"""The folder of a workbench: records, plans, runs and logs in it, and what else must outlive the server."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydraulic_node_utils.json_file import json_object
from hydraulic_node_utils.whole_file import write_text
from hydraulic_workbench.errors import WorkbenchError

MEMORY = "workbench.json"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._-]{0,80}")


@dataclass(frozen=True)
class Folder:
    """Where things are kept. Nothing in it is ever replaced, but for the workbench's own memory."""

    root: Path

    def __post_init__(self) -> None:
        for part in (self.records, self.plans, self.runs, self.logs, self.uploads):
            part.mkdir(parents=True, exist_ok=True)

    @property
    def records(self) -> Path:
        """Bags of experiments, and imported records."""
        return self.root / "records"

    @property
    def plans(self) -> Path:
        """Plans that were designed."""
        return self.root / "plans"

    @property
    def runs(self) -> Path:
        """One folder for each run of a verb."""
        return self.root / "runs"

    @property
    def logs(self) -> Path:
        """What the processes print."""
        return self.root / "logs"

    @property
    def uploads(self) -> Path:
        """Files that have come from the page and are not records yet."""
        return self.root / "uploads"

    def new(self, parent: Path, name: str) -> Path:
        """A path that is not there yet, made from a name."""
        safe = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._") or "unnamed"
        stem, dot, kind = safe.partition(".")
        known = (safe, *(f"{stem}_{number}{dot}{kind}" for number in range(2, 10_000)))
        return next(parent / one for one in known if not (parent / one).exists())

    def recall(self) -> dict[str, Any]:
        """What an earlier server has kept; empty where there was none."""
        try:
            return json_object((self.root / MEMORY).read_text("utf-8"))
        except (OSError, UnicodeDecodeError):
            return {}

    def keep(self, memory: dict[str, Any]) -> None:
        """Write what a later server shall know."""
        write_text(self.root / MEMORY, json.dumps(memory, indent=1) + "\n")


def checked_name(text: Any, field: str) -> str:
    """A name that a file may have.

    :raises WorkbenchError: it is none.
    """
    if not isinstance(text, str) or not _NAME.fullmatch(text):
        raise WorkbenchError(f"{field} is {text!r}; allowed are letters, digits, blanks and . _ - (up to 80)", field)
    return text
