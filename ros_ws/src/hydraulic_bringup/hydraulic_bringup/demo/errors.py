"""What a demo tells its user when a step fails."""

from __future__ import annotations


class DemoError(Exception):
    """A step failed. ``step`` which, ``why`` in one or more lines, ``remedy`` what to do about it."""

    def __init__(self, step: str, why: str, remedy: str = "") -> None:
        super().__init__(f"{step}: {why}")
        self.step, self.why, self.remedy = step, why, remedy
