"""What the page is told when something cannot be done; each kind has its HTTP status."""

from __future__ import annotations

from hydraulic_interfaces.errors import HydraulicError


class WorkbenchError(HydraulicError):
    """The request is at fault; ``field`` names the part of it that is."""

    status = 400

    def __init__(self, text: str, field: str | None = None) -> None:
        super().__init__(text)
        self.field = field


class NotAllowedError(WorkbenchError):
    """This visitor may not do that."""

    status = 403


class UnknownError(WorkbenchError):
    """Nothing is known by that name."""

    status = 404


class NotNowError(WorkbenchError):
    """It cannot be done in the state that things are in."""

    status = 409


class TooLargeError(WorkbenchError):
    """More than the server takes."""

    status = 413
