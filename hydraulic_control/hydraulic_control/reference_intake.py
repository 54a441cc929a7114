"""Which references the controller follows, and when it drops the one that it has.

A reference is a wish of its instant. One that comes late is refused, and one that the plant could not follow is
dropped: whoever enables a plant again must not be surprised by what was wished before.
"""

from __future__ import annotations

import math

from hydraulic_control.refusals import Refusal
from hydraulic_interfaces.samples import Reference

PAUSE_S = 0.5
"""After a reference was dropped, its source must be silent for this long: what comes then is a new wish."""

BACKWARDS_NS = 1_000_000_000
"""A stamp further back than this is that of a clock which started anew."""


class ReferenceIntake:
    """Holds the reference that is followed, or the position that was found where there is none.

    ``travel`` [m]: largest reference to either side. ``age_limit`` [s]: a reference that is older, or further in the
    future, when it comes is refused. ``timeout`` [s]: one that has not been renewed for as long is held without its
    velocity; a set point that was sent once is held until another one comes.
    """

    def __init__(self) -> None:
        self.travel, self.age_limit, self.timeout = 0.7, 0.5, 0.1
        self.forget()

    def forget(self) -> None:
        """Begin anew: neither reference nor position, and the next reference is followed whoever sends it."""
        self.reference: Reference | None = None
        self._held = math.nan
        self._heard_ns: int | None = None  # newest stamp of a source whose reference was dropped

    def take(self, reference: Reference, now_ns: int) -> tuple[Refusal, str] | None:
        """Follow a reference that came at ``now_ns``; what is wrong with it where it is not followed."""
        if not (math.isfinite(reference.position) and abs(reference.position) <= self.travel):
            return Refusal.BAD_REFERENCE, f"{reference.position:g} m, allowed are ±{self.travel:g} m"
        if math.isinf(reference.velocity):
            return Refusal.BAD_REFERENCE, f"velocity {reference.velocity:g} m/s"
        age = (now_ns - reference.stamp_ns) * 1e-9
        if reference.stamp_ns <= 0:
            return Refusal.OLD_REFERENCE, "stamp 0"
        if abs(age) > self.age_limit:
            return Refusal.OLD_REFERENCE, f"{age:.3f} s old, allowed are ±{self.age_limit:g} s"
        # A source that starts anew with another clock must be heard: only a little backwards is out of order.
        if self.reference is not None and 0 < self.reference.stamp_ns - reference.stamp_ns < BACKWARDS_NS:
            return Refusal.LATE_REFERENCE, ""
        if self._outlived(reference.stamp_ns):
            return Refusal.OUTLIVED_REFERENCE, ""
        self.reference = reference
        return None

    def drop(self) -> None:
        """Follow the reference no longer, nor its source as long as it goes on; the position is still to be held."""
        if self.reference is not None:
            self._heard_ns = self.reference.stamp_ns
        self.reference = None

    def hold(self, position: float) -> None:
        """Hold a position [m] while there is no reference."""
        self._held = min(max(position, -self.travel), self.travel)

    def goal(self, stamp_ns: int) -> tuple[float, float]:
        """Position [m] and velocity [m/s] to be had at ``stamp_ns``."""
        reference = self.reference
        if reference is None:
            return self._held, 0.0
        fresh = (stamp_ns - reference.stamp_ns) * 1e-9 <= self.timeout
        return reference.position, reference.velocity if fresh else 0.0

    def _outlived(self, stamp_ns: int) -> bool:
        heard = self._heard_ns
        if heard is None:
            return False
        goes_on = abs(stamp_ns - heard) * 1e-9 < PAUSE_S
        self._heard_ns = stamp_ns if goes_on else None
        return goes_on
