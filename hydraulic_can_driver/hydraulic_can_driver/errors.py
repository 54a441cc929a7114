"""The errors of this package; each message says what, where, the value and what is allowed."""

from hydraulic_interfaces.errors import HydraulicError


class BusFileError(HydraulicError, ValueError):
    """A bus file is not acceptable; the text begins with file and line."""


class CodecError(HydraulicError, ValueError):
    """A value or a frame that an object of a device cannot carry."""


class DeviceError(HydraulicError, RuntimeError):
    """A device on the bus does not do, or is not, what the bus file says."""

    exit_code = 1


class BusDownError(HydraulicError, OSError):
    """Nothing can be sent or received: the interface is missing, down, or has gone bus-off."""

    exit_code = 1
