"""The model of this workbench and how it became what it is: one step for each change, the file behind every step."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hydraulic_workbench.errors import NotNowError, UnknownError


@dataclass(frozen=True)
class Step:
    """One step: what was done, the model file it led to, and the residual over noise before and after."""

    what: str
    file: str
    effect: str | None = None
    error_before: float | None = None
    error_after: float | None = None
    run: str | None = None
    time: float = field(default_factory=time.time)


class Timeline:
    """Steps in the order they were made, and which of them holds now. ``changed`` is called after every change."""

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self.steps: list[Step] = []
        self.index = -1

    @property
    def current(self) -> Step:
        """The step that holds."""
        return self.steps[self.index]

    @property
    def can_undo(self) -> bool:
        """Whether there is a step before."""
        return self.index > 0

    def add(self, step: Step) -> None:
        """Go on with another model. What had been undone is no longer on the way, its files stay."""
        if self.steps and step.what == "chosen" and step.file == self.current.file:
            return
        self.steps = [*self.steps[: self.index + 1], step]
        self.index = len(self.steps) - 1
        self._changed()

    def undo(self) -> None:
        """Back to the step before.

        :raises NotNowError: there is none.
        """
        if not self.can_undo:
            raise NotNowError("this is the first model: there is nothing to undo")
        self.go(self.index - 1)

    def go(self, index: Any) -> None:
        """To any step.

        :raises UnknownError: there is no such step.
        """
        if not isinstance(index, int) or not 0 <= index < len(self.steps):
            raise UnknownError(f"there is no step {index!r}; there are 0 … {len(self.steps) - 1}", "index")
        self.index = index
        self._changed()

    def memory(self) -> dict[str, Any]:
        """What a later server needs to know."""
        return {"steps": [asdict(step) for step in self.steps], "index": self.index}

    def recall(self, memory: Any) -> None:
        """Take the steps of an earlier server, as far as their files are there."""
        try:
            steps = [Step(**row) for row in memory["steps"]]
            index = int(memory["index"])
        except (KeyError, TypeError, ValueError):
            return
        if steps and 0 <= index < len(steps) and all(Path(step.file).is_file() for step in steps):
            self.steps, self.index = steps, index
