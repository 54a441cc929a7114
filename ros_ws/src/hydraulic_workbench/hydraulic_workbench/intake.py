"""What the server knows of the streams that it listens to."""

from __future__ import annotations

from typing import Protocol


class Intake(Protocol):
    """The streams of the live view."""

    @property
    def age(self) -> float:
        """Seconds since the last state came; infinite before the first."""

    @property
    def missing(self) -> int:
        """Messages of all streams that did not come."""

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest state; 0 before the first."""
