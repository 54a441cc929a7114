"""From states and references to commands: what the controller node does, without ROS.

Every state that can be acted on is answered with exactly one drive; one that cannot (not finite, out of order, too
old) is counted and answered with 0 V or not at all. Between them the loop is at rest: it begins anew, without a bump,
holding the position that it finds.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from enum import Enum

from hydraulic_control.controller import Controller
from hydraulic_interfaces.samples import PlantSample, Reference


class Refusal(Enum):
    """What a state or a reference was refused for."""

    NOT_FINITE = "state: position or velocity is not a number"
    OUT_OF_ORDER = "state: stamp does not advance"
    STALE = "state: older than the limit"
    SILENT = "state: none came for longer than the limit"
    IMPLAUSIBLE = "state: position leaps further than the actuator can move"
    BAD_REFERENCE = "reference: not a number, or outside the travel"
    LATE_REFERENCE = "reference: stamp does not advance"
    NOT_OBEYED = "drive: the plant does not apply what is commanded"


_REMEMBERED = 20  # commands, within which an obedient plant has applied one
_BACKWARDS_NS = 1_000_000_000  # a stamp further back than this is that of a clock which started anew


class ControlSession:
    """Holds the controller, the newest reference and the times; stamps are ns of the plant's clock.

    ``age_limit`` [s]: a state older than this, or silence for as long, gives 0 V. ``reference_timeout`` [s]: a
    reference that has not been renewed for as long is held without its velocity. ``travel`` [m]: largest reference to
    either side. ``speed_limit`` [m/s]: a position that leaps faster is not believed, unless the next one confirms it.
    ``applied_tolerance`` [V]: a plant whose applied drive is further from every recent command does not obey (disabled,
    stopped, another source): the controller then joins on to the applied drive, so that nothing has wound up when the
    plant obeys again. 0 switches that off.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.age_limit, self.reference_timeout = 0.02, 0.1
        self.travel, self.speed_limit = 0.7, 20.0
        self.applied_tolerance = 0.5
        self.refusals: Counter[Refusal] = Counter()
        self.trouble = ""
        self.answered = 0
        self.reference: Reference | None = None
        self._held = math.nan
        self._stamp_ns: int | None = None
        self._position = math.nan
        self.error = math.nan
        self._commands: deque[float] = deque(maxlen=_REMEMBERED)

    def begin(self) -> None:
        """Start anew: the next state is held until a reference comes."""
        self.controller.stop()
        self.reference, self._held = None, math.nan
        self._stamp_ns, self._position, self.error = None, math.nan, math.nan
        self.trouble = ""
        self._commands.clear()

    def follow(self, reference: Reference) -> bool:
        """Take a reference; False, and a count, for one that is not acceptable or older than the one there is."""
        if not (math.isfinite(reference.position) and abs(reference.position) <= self.travel):
            self._refuse(Refusal.BAD_REFERENCE, f"{reference.position:g} m, allowed are ±{self.travel:g} m")
            return False
        if math.isinf(reference.velocity):
            self._refuse(Refusal.BAD_REFERENCE, f"velocity {reference.velocity:g} m/s")
            return False
        # A source that starts anew with another clock must be heard: only a little backwards is out of order.
        if self.reference is not None and 0 < self.reference.stamp_ns - reference.stamp_ns < _BACKWARDS_NS:
            self._refuse(Refusal.LATE_REFERENCE, "")
            return False
        self.reference = reference
        return True

    def answer(self, sample: PlantSample, now_ns: int) -> float | None:
        """Drive [V] for a state that arrived at ``now_ns``; None for one that must not be answered again."""
        stamp, position = sample.stamp_ns, sample.position
        last = self._stamp_ns
        if last is not None and stamp <= last and last - stamp < _BACKWARDS_NS:
            self._refuse(Refusal.OUT_OF_ORDER, "")
            return None
        age = (now_ns - stamp) * 1e-9
        if age > self.age_limit:
            self._stamp_ns = stamp
            return self._rest(Refusal.STALE, f"{age:.3f} s, allowed are {self.age_limit:g} s")
        if not math.isfinite(position) or math.isinf(sample.velocity):
            self._stamp_ns = stamp
            return self._rest(Refusal.NOT_FINITE, "")
        dt = 0.0 if last is None else (stamp - last) * 1e-9
        self._stamp_ns = stamp
        leapt = abs(position - self._position) > self.speed_limit * dt
        self._position = position
        if not 0.0 < dt <= self.age_limit:
            # The first state, or one after a gap: nothing to differentiate yet.
            return self._start(sample)
        if leapt:
            return self._rest(Refusal.IMPLAUSIBLE, f"to {position:g} m within {dt:g} s")
        if not self._obeyed(sample.drive):
            self._refuse(Refusal.NOT_OBEYED, f"it applies {sample.drive:g} V")
            self._start(sample)
        goal, velocity = self._goal(stamp)
        self.error = goal - position
        self.answered += 1
        drive = self.controller.step(dt, goal, velocity, position, sample.force)
        self._commands.append(drive)
        return drive

    def silence(self, age: float) -> bool:
        """To be called while no state comes, ``age`` [s] after the last: True, and a count, once when it is too old."""
        if age <= self.age_limit or self._stamp_ns is None or not self.controller.running:
            return False
        self._rest(Refusal.SILENT, f"{age:.3f} s, allowed are {self.age_limit:g} s")
        return True

    def _goal(self, stamp_ns: int) -> tuple[float, float]:
        reference = self.reference
        if reference is None:
            return self._held, 0.0
        fresh = (stamp_ns - reference.stamp_ns) * 1e-9 <= self.reference_timeout
        return reference.position, reference.velocity if fresh else 0.0

    def _start(self, sample: PlantSample) -> float:
        """Begin at rest; join on to the drive that is applied."""
        self.controller.stop(sample.drive)
        self._commands.clear()
        if self.reference is None:
            self._held = min(max(sample.position, -self.travel), self.travel)
        return self.controller.drive

    def _obeyed(self, applied: float) -> bool:
        commands, tolerance = self._commands, self.applied_tolerance
        if len(commands) < _REMEMBERED or tolerance <= 0.0:
            return True
        return min(commands) - tolerance <= applied <= max(commands) + tolerance

    def _rest(self, refusal: Refusal, detail: str) -> float:
        self._refuse(refusal, detail)
        self.controller.stop()
        return 0.0

    def _refuse(self, refusal: Refusal, detail: str) -> None:
        self.refusals[refusal] += 1
        self.trouble = f"{refusal.value}: {detail}" if detail else refusal.value
