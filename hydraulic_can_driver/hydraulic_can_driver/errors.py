"""The errors of this package; each message says what, where, the value and what is allowed."""

from __future__ import annotations


class CanDriverError(Exception):
    """Base of every error of this package."""


class BusFileError(CanDriverError, ValueError):
    """A bus file is not acceptable; the text begins with file and line."""


class CodecError(CanDriverError, ValueError):
    """A value or a frame that a process data object cannot carry."""


class DeviceError(CanDriverError, RuntimeError):
    """A device on the bus does not do, or is not, what the bus file says."""


class BusDownError(CanDriverError, OSError):
    """Nothing can be sent or received: the interface is missing, down, or has gone bus-off."""
