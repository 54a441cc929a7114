"""Whether a stream has come without gaps, by the numbers its publisher gives the messages."""

from __future__ import annotations


class Continuity:
    """Counts what is missing in one topic; judges only while it has exactly one publisher."""

    def __init__(self) -> None:
        self.missing = 0
        self._last = 0
        self._publishers = 0

    def publishers_are(self, count: int) -> None:
        """How many publishers there are; numbers of different ones cannot be compared."""
        if count != self._publishers:
            self._publishers = count
            self._last = 0

    def take(self, number: int) -> None:
        """A message with this number has come."""
        # A number that went back is a publisher that was started anew.
        if self._publishers == 1 and 0 < self._last < number - 1:
            self.missing += number - self._last - 1
        self._last = number


class Gaps:
    """Counts what is missing in one topic of a file, whose number of publishers is not known."""

    def __init__(self) -> None:
        self._missing = 0
        self._last: int | None = None
        self._one_publisher = True

    def take(self, number: int) -> None:
        """A message with this number is there."""
        if self._last is not None:
            self._missing += number - self._last - 1
            # Not after the one before: of another publisher, or both without a number.
            self._one_publisher &= number > self._last
        self._last = number

    @property
    def missing(self) -> int | None:
        """Messages missing between the first and the last one; None where the numbers do not show it."""
        return self._missing if self._one_publisher else None
