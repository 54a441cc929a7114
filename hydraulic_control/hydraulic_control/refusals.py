"""What the controller does not act on, and what each is called."""

from enum import Enum


class Refusal(Enum):
    """What a state or a reference was refused for, or why a reference was dropped."""

    NOT_FINITE = "state: position or velocity is not a number"
    OUT_OF_ORDER = "state: stamp does not advance"
    STALE = "state: older than the limit"
    FUTURE = "state: further in the future than the limit"
    SILENT = "state: none came for longer than the limit"
    IMPLAUSIBLE = "state: position leaps further than the actuator can move"
    BAD_REFERENCE = "reference: not a number, or outside the travel"
    LATE_REFERENCE = "reference: stamp does not advance"
    OLD_REFERENCE = "reference: stamp is 0, too old, or of another clock"
    OUTLIVED_REFERENCE = "reference: its source went on while the plant did not obey; it must pause or start anew"
    LIMITED = "drive: the plant applies less than is commanded"
    NOT_OBEYED = "drive: the plant does not apply what is commanded; it holds the position found"
