"""The gate of every command to an actuator: limits, watchdog, one source at a time, emergency stop.

Rules, the same for a simulated and a real actuator:

- A command must be finite, name its source, and be no older than the watchdog time (nor as far in the future:
  its sender uses another clock). Anything else is rejected and counted. Out of range is clamped and counted.
- The stamps of a source advance: a command that is stamped no later than one that was obeyed is refused.
- The first source heard is obeyed; another one is refused until the first has been silent for the watchdog
  time. So is another publisher that uses the same name: its messages are not the next ones of the publisher in
  command. Where the counts of two publishers meet, nobody can tell them apart any more, and both are stopped.
- Without a valid command for the watchdog time the drive is 0 V; the next valid command re-arms it.
- A stop (emergency or fault) is latched until `reset`. Reset leaves the gate disabled: moving again takes
  `enable`.
- While disabled or stopped the drive is 0 V and commands are refused, so that none waits for the enable.
- What is applied may be less than what is held: `limits` know where the piston is (slew, braking before the ends).
- Enabling, disabling and stopping each take the held drive away, also where one undoes the other before the next
  cycle: what was commanded before does not move anything after.

The gate knows no threads: `accept` and `drive` belong to one thread, the switches may be thrown from another.
"""

from __future__ import annotations

import math
from collections import Counter
from enum import Enum

from hydraulic_interfaces.contract import DRIVE_LIMIT_V, WATCHDOG_S
from hydraulic_interfaces.samples import Command
from hydraulic_plant_node.travel_limits import TravelLimits


class Verdict(Enum):
    """What became of a command."""

    ACCEPTED = "accepted"
    CLAMPED = "clamped to the limits"
    MALFORMED = "rejected: not a command for the servo valve"
    NOT_FINITE = "rejected: drive is not finite"
    UNNAMED = "rejected: frame_id names no source"
    STALE = "rejected: older than the watchdog time"
    FUTURE = "rejected: stamped in the future, the sender uses another clock"
    OTHER_SOURCE = "refused: another source is in command"
    OTHER_PUBLISHER = "refused: not of the publisher in command, which has the same name"
    OUT_OF_ORDER = "refused: not stamped later than the last"
    DISABLED = "refused: not enabled"
    STOPPED = "refused: stopped until reset"

    @property
    def obeyed(self) -> bool:
        """Whether the command moves the actuator."""
        return self in (Verdict.ACCEPTED, Verdict.CLAMPED)


class CommandGate:
    """Decides which commands count and what drive [V] applies; `limit` in V, `watchdog` in s.

    `rivalled` is the name of the last source that a second publisher has used while it was in command.
    """

    def __init__(self, limit: float = DRIVE_LIMIT_V, watchdog: float = WATCHDOG_S) -> None:
        if not (math.isfinite(limit) and limit > 0.0):
            raise ValueError(f"drive limit is {limit} V, must be positive and finite")
        self.limit = limit
        self.watchdog = watchdog
        self.counts: Counter[Verdict] = Counter()
        self.timeouts = 0
        self.enabled = False
        self.stop_reason = ""
        self.last_problem = ""
        self.rivalled = ""
        self.limits: TravelLimits | None = None
        self._source = ""
        self._number: int | None = None
        self._stamps_ns: dict[str, int] = {}
        self._drive = 0.0
        self._heard_ns: int | None = None
        self._answered_ns = (0, 0)
        # A new object per change of `enabled`: unlike a count it loses none where two threads change it at once.
        self._change = self._seen_change = object()

    @property
    def watchdog(self) -> float:
        """Longest silence of the source in command, s."""
        return self._watchdog_ns * 1e-9

    @watchdog.setter
    def watchdog(self, seconds: float) -> None:
        if not (math.isfinite(seconds) and seconds > 0.0):
            raise ValueError(f"watchdog is {seconds} s, must be positive and finite")
        self._watchdog_ns = round(seconds * 1e9)

    @property
    def source(self) -> str:
        """Name of the source in command; empty when there is none."""
        return self._source

    @property
    def answered_ns(self) -> tuple[int, int]:
        """Stamps of the last two commands that were obeyed, or would have been had they come sooner; newest first."""
        return self._answered_ns

    @property
    def stopped(self) -> bool:
        """Whether a stop is latched."""
        return bool(self.stop_reason)

    def enable(self, on: bool) -> bool:
        """Let commands through, or not; False when a latched stop forbids it."""
        allowed = on and not self.stopped
        if allowed != self.enabled:
            self._change = object()
        self.enabled = allowed
        return self.enabled == on

    def stop(self, reason: str) -> None:
        """Latch 0 V until `reset`; the first reason is kept."""
        self.stop_reason = self.stop_reason or reason or "stopped"
        self._change = object()
        self.enabled = False

    def reset(self) -> None:
        """Release the latched stop, if there is one; the gate then stays disabled until `enable`."""
        if self.stop_reason:
            # An `enable` at the moment of the stop may have come after it; it must not move anything now.
            self.enabled = False
        self.stop_reason = ""

    def forget(self) -> None:
        """Begin at 0 V without a source; for the thread of `accept` and `drive`, before its first cycle."""
        self._release()
        if self.limits is not None:
            self.limits.forget()

    def age(self, now_ns: int) -> float:
        """Seconds since the last obeyed command arrived; NaN when no source is in command."""
        return math.nan if self._heard_ns is None else (now_ns - self._heard_ns) * 1e-9

    def accept(self, command: Command, now_ns: int, number: int | None = None, alone: bool = True) -> Verdict:
        """Judge a command that arrived at `now_ns`, and hold its drive if it is obeyed.

        `number`: the count of this message at its publisher, where the middleware gives it. Only where its publisher
        is `alone` on the topic may numbers be missing in between.
        """
        self._follow_changes()
        verdict = self._judge(command, now_ns, number, alone)
        self.counts[verdict] += 1
        if verdict.obeyed:
            self._remember(command, now_ns)
            self._number = number
            self._source = command.source
            self._drive = min(max(command.drive, -self.limit), self.limit)
            self._heard_ns = now_ns
        elif self._in_command(now_ns) and command.source == self._source and self._follows(number, alone):
            self._number = number  # refused for what it says, it is still the next one of its publisher
        if verdict.obeyed or verdict is Verdict.STALE and self.enabled and self._source in ("", command.source):
            self._answered_ns = command.stamp_ns, self._answered_ns[0]
        if verdict is not Verdict.ACCEPTED:
            self.last_problem = f"{verdict.value} (source {command.source!r}, {command.drive:.4g} V)"
        return verdict

    def reject(self, reason: str) -> Verdict:
        """Count a message that could not be read as a command; `reason` says why."""
        self.counts[Verdict.MALFORMED] += 1
        self.last_problem = f"{Verdict.MALFORMED.value}: {reason}"
        return Verdict.MALFORMED

    def drive(self, now_ns: int) -> float:
        """The drive to apply in this cycle, V: always finite and within the limits."""
        self._follow_changes()
        if self._heard_ns is not None and not self._in_command(now_ns):
            # Only a silence that takes a drive away from an enabled actuator is a fault of the source.
            self.timeouts += self.enabled
            self._release()
        if self.stop_reason or not self.enabled:
            self._release()
        return self._drive if self.limits is None else self.limits.limited(self._drive)

    def observe(self, position: float) -> None:
        """The piston was at ``position`` [m], NaN where nobody knows; for the thread of `drive`, after each sample."""
        if self.limits is not None:
            self.limits.observe(position)

    def _judge(self, command: Command, now_ns: int, number: int | None, alone: bool) -> Verdict:
        age_ns = now_ns - command.stamp_ns
        if not command.source:
            return Verdict.UNNAMED
        if not math.isfinite(command.drive):
            return Verdict.NOT_FINITE
        if age_ns > self._watchdog_ns:
            return Verdict.STALE
        if age_ns < -self._watchdog_ns:
            return Verdict.FUTURE
        if self.stop_reason:
            return Verdict.STOPPED
        if not self.enabled:
            return Verdict.DISABLED
        if self._in_command(now_ns) and command.source != self._source:
            return Verdict.OTHER_SOURCE
        if self._in_command(now_ns) and not self._follows(number, alone):
            self._meet_rival(number, now_ns)
            return Verdict.OTHER_PUBLISHER
        last_ns = self._stamps_ns.get(command.source)
        # A last stamp that would be refused now itself is that of a clock which was set back.
        if last_ns is not None and command.stamp_ns <= last_ns <= now_ns + self._watchdog_ns:
            return Verdict.OUT_OF_ORDER
        return Verdict.ACCEPTED if abs(command.drive) <= self.limit else Verdict.CLAMPED

    def _follows(self, number: int | None, alone: bool) -> bool:
        """Whether the publisher in command may have sent this number."""
        if number is None or self._number is None:
            return True
        return number > self._number if alone else number == self._number + 1

    def _meet_rival(self, number: int | None, now_ns: int) -> None:
        self.rivalled = self._source
        # The counts meet. A silent publisher will not go on from here, one that speaks will.
        if number == self._number and self.age(now_ns) <= WATCHDOG_S:
            self.stop(f"two publishers call themselves {self._source!r} and cannot be told apart")

    def _remember(self, command: Command, now_ns: int) -> None:
        """Keep the stamp of an obeyed command for as long as its age alone would not give a replay away."""
        if command.source not in self._stamps_ns:
            near = {name: at for name, at in self._stamps_ns.items() if abs(now_ns - at) <= self._watchdog_ns}
            self._stamps_ns = near
        self._stamps_ns[command.source] = command.stamp_ns

    def _in_command(self, now_ns: int) -> bool:
        # A clock that jumped back must not keep an old command alive.
        return self._heard_ns is not None and 0 <= now_ns - self._heard_ns <= self._watchdog_ns

    def _follow_changes(self) -> None:
        change = self._change
        if change is not self._seen_change:
            self._seen_change = change
            self._release()

    def _release(self) -> None:
        self._source, self._drive, self._heard_ns, self._number = "", 0.0, None, None
