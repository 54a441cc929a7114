"""From states and references to commands: what the controller node does, without ROS.

Every state that can be acted on is answered with exactly one drive; one that cannot (not finite, out of order, too
old) is counted and answered with 0 V or not at all. Between them the loop is at rest: it begins anew, without a bump,
holding the position that it finds.
"""

from __future__ import annotations

import math
from collections import Counter, deque

from hydraulic_control.controller import Controller
from hydraulic_control.reference_intake import BACKWARDS_NS, PAUSE_S, ReferenceIntake
from hydraulic_control.refusals import Refusal
from hydraulic_interfaces.samples import PlantSample, Reference

_REMEMBERED = 20  # commands, within which an obedient plant has applied one


class ControlSession:
    """Holds the controller, the references and the times; stamps are ns of the plant's clock.

    ``age_limit`` [s]: a state older than this, or as far in the future, or silence for as long, gives 0 V.
    ``speed_limit`` [m/s]: a position that leaps faster is not believed, unless the next one confirms it.
    ``applied_tolerance`` [V]: a plant whose applied drive is further from every recent command does not obey. Where it
    applies a part of them, it limits: the controller joins on to the applied drive, so that nothing winds up. Else
    (disabled, stopped, another source) the reference is dropped too, and the position found is held.
    """

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.references = ReferenceIntake()
        self.age_limit, self.speed_limit, self.applied_tolerance = 0.02, 20.0, 0.05
        self.refusals: Counter[Refusal] = Counter()
        self.trouble = ""
        self.answered = 0
        self._stamp_ns: int | None = None
        self._position = math.nan
        self._anew = True  # the next state is a first one
        self.error = math.nan
        self._commands: deque[float] = deque(maxlen=_REMEMBERED)

    @property
    def reference(self) -> Reference | None:
        """What is followed; None while the position found is held."""
        return self.references.reference

    def begin(self) -> None:
        """Start anew: the next state is held until a reference comes."""
        self.controller.stop()
        self.references.forget()
        self._stamp_ns, self._position, self.error = None, math.nan, math.nan
        self.trouble = ""
        self._commands.clear()

    def follow(self, reference: Reference, now_ns: int) -> bool:
        """Take a reference that came at ``now_ns``; False, and a count, for one that is not followed."""
        problem = self.references.take(reference, now_ns)
        if problem is not None:
            self._refuse(*problem)
        return problem is None

    def disobeyed(self, reason: str, stamp_ns: int) -> None:
        """The plant said so at ``stamp_ns``: drop the reference, unless it is newer; hold what the next state says."""
        if self.reference is not None:
            if self.reference.stamp_ns > stamp_ns:
                return
            self._refuse(Refusal.NOT_OBEYED, reason)
        self.references.drop()
        self._anew = True

    def answer(self, sample: PlantSample, now_ns: int) -> float | None:
        """Drive [V] for a state that arrived at ``now_ns``; None for one that must not be answered again."""
        stamp, position = sample.stamp_ns, sample.position
        last = self._stamp_ns
        if last is not None and stamp <= last and last - stamp < BACKWARDS_NS:
            self._refuse(Refusal.OUT_OF_ORDER, "")
            return None
        age = (now_ns - stamp) * 1e-9
        if age < -self.age_limit:
            return self._rest(Refusal.FUTURE, f"{-age:.3f} s, allowed are {self.age_limit:g} s")
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
        if not 0.0 <= dt < PAUSE_S:
            self.references.drop()  # the plant was away
        if self._anew or not 0.0 < dt <= self.age_limit:
            # The first state, or one after a gap: nothing to differentiate yet.
            self._anew = False
            return self._start(sample)
        if leapt:
            return self._rest(Refusal.IMPLAUSIBLE, f"to {position:g} m within {dt:g} s")
        if refusal := self._disobedience(sample.drive):
            self._refuse(refusal, f"it applies {sample.drive:g} V")
            if refusal is Refusal.NOT_OBEYED:
                self.references.drop()
            self._start(sample)
        goal, velocity = self.references.goal(stamp)
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

    def _start(self, sample: PlantSample) -> float:
        """Begin at rest; join on to the drive that is applied."""
        self.controller.stop(sample.drive)
        self._commands.clear()
        if self.reference is None:
            self.references.hold(sample.position)
        return self.controller.drive

    def _disobedience(self, applied: float) -> Refusal | None:
        commands, tolerance = self._commands, self.applied_tolerance
        if len(commands) < _REMEMBERED:
            return None
        low, high = min(commands), max(commands)
        if low - tolerance <= applied <= high + tolerance:
            return None
        return Refusal.LIMITED if tolerance < applied < low or high < applied < -tolerance else Refusal.NOT_OBEYED

    def _rest(self, refusal: Refusal, detail: str) -> float:
        self._refuse(refusal, detail)
        self.controller.stop()
        self._commands.append(0.0)
        return 0.0

    def _refuse(self, refusal: Refusal, detail: str) -> None:
        self.refusals[refusal] += 1
        self.trouble = f"{refusal.value}: {detail}" if detail else refusal.value
