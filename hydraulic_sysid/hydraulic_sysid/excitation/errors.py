"""Errors of excitation plans and their signals."""

from __future__ import annotations

from hydraulic_interfaces.errors import HydraulicError


class ExcitationError(HydraulicError, ValueError):
    """Base of everything that excitation plans and runs raise."""


class PlanError(ExcitationError):
    """A plan, or the signal in it, says something that cannot be played.

    Attributes: ``where`` (file and section), ``key``, ``value`` as given, ``allowed`` as text.
    """

    def __init__(self, where: str, key: str, value: object, allowed: str) -> None:
        self.where, self.key, self.value, self.allowed = where, key, value, allowed
        prefix = f"{where}: " if where else ""
        super().__init__(f"{prefix}{key} = {value!r}; allowed: {allowed}")

    def inside(self, place: str) -> PlanError:
        """The same error, with the place that holds it put in front (file, section)."""
        return PlanError(f"{place}: {self.where}" if self.where else place, self.key, self.value, self.allowed)


class PlaybackError(ExcitationError):
    """A drive file to be played back is unreadable; the message names file, row and column."""
