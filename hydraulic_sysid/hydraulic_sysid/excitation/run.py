"""One run of a plan: from each measured position the next drive, and the reasons to stop."""

from __future__ import annotations

import math
from enum import Enum

from hydraulic_sysid.excitation.answer import Answers, answer, strays, why
from hydraulic_sysid.excitation.applied import AppliedDriveCheck
from hydraulic_sysid.excitation.plan import Plan

STOP_RAMP_S = 0.1
HOLD_S = 0.1


class Phase(Enum):
    """Where a run is."""

    PLAYING = "playing"
    STOPPING = "stopping"  # was asked to stop: the drive falls to zero
    ABORTED = "aborted"  # 0 V is held for HOLD_S
    FINISHED = "finished"


class ExcitationRun:
    """Plays a plan sample by sample: u = w·(signal + offset + centring), within ± the plan's amplitude limit.

    Centring is −k_c·(x − x_c), clamped to the plan's `centring_limit`: a servo valve plant integrates, and
    without it the piston drifts to a stop. It is meant to be weak: k_c times the velocity gain is far below
    the lowest frequency of interest. What it adds is part of the applied drive, and so of the record.

    During the plan's approach the drive is u = −k_a·(x − x_c), clamped to the plan's `approach_limit`.

    The drive comes from the time of the state, not from a count of calls: a lost state shortens nothing. The
    run aborts — 0 V at once — on a position that is no number, beyond the travel limit or too old, and on a
    drive that the plant does not apply. It never moves again after that. While no state comes nothing is
    commanded either, so that the plant's watchdog holds 0 V long before `state_timeout` ends the run.
    """

    def __init__(
        self, plan: Plan, *, state_timeout: float = 0.5, applied_check: AppliedDriveCheck | None = None
    ) -> None:
        self.plan = plan
        self.phase = Phase.PLAYING
        self.reason = ""
        self.requested = False  # that it ends was asked for; nothing went wrong
        self.drive = 0.0
        self.played = 0
        self._state_timeout = state_timeout
        self._applied_check = applied_check
        # Lists of floats: indexing an array costs ten times more.
        own = Answers.of(plan)
        self._answers = own._replace(open_loop=plan.open_loop.tolist(), envelope=plan.envelope.tolist())
        self._start: float | None = None
        self._time = -math.inf
        self._index = -1
        self._end = math.inf
        self._stop_drive = 0.0

    @property
    def done(self) -> bool:
        """Nothing is left to command."""
        return self.phase is Phase.FINISHED or (self.phase is Phase.ABORTED and self._time >= self._end)

    @property
    def progress(self) -> float:
        """The played part of the plan, 0 … 1."""
        return min(1.0, (self._index + 1) / len(self._answers.open_loop))

    def step(self, t: float, position: float, applied: float | None = None) -> float:
        """The drive [V] that answers the state sampled at `t` [s] with the piston at `position` [m].

        `applied` is the drive [V] that the plant reports in that state. The first call starts the run.
        """
        if self._start is None:
            self._start = self._time = t
        if self.phase in (Phase.PLAYING, Phase.STOPPING):
            self._guard(t, position, applied)
        self._time = max(self._time, t)  # in this order a NaN changes nothing
        if self.phase is Phase.PLAYING:
            self._play(t, position)
        elif self.phase is Phase.STOPPING:
            self._fall()
        if self._applied_check is not None:
            self._applied_check.commanded(self.drive)
        return self.drive

    def abort(self, reason: str) -> None:
        """End the run at once: 0 V, held for HOLD_S. A run that is over stays as it is."""
        if self.phase in (Phase.PLAYING, Phase.STOPPING):
            self.phase, self.drive = Phase.ABORTED, 0.0
            self.reason = self.reason or reason  # what was asked first is the cause
            self._end = self._time + HOLD_S

    def stop(self, reason: str) -> None:
        """End the run on request: the drive falls to zero within STOP_RAMP_S, then the run is aborted."""
        if self.phase is Phase.PLAYING:
            self.phase, self.reason, self.requested = Phase.STOPPING, reason, True
            self._stop_drive, self._end = self.drive, self._time + STOP_RAMP_S

    def check_age(self, age: float) -> bool:
        """Abort when `age` [s] of the last state is beyond what is allowed, and say whether it is.

        To be called by a clock that runs while no state comes.
        """
        silent = age > self._state_timeout
        if silent:
            self.abort(f"no state for {age:.3f} s (allowed: {self._state_timeout:g} s)")
        return silent

    def _guard(self, t: float, position: float, applied: float | None) -> None:
        if not math.isfinite(t) or t < self._time:
            self.abort(f"the time of the state went from {self._time:.6f} s to {t:.6f} s")
        self.check_age(t - self._time)
        if strays(self._answers, self._index, position):
            self.abort(why(self._answers, position))
        if applied is not None and self._applied_check is not None:
            fault = self._applied_check.fault(t, applied)
            if fault:
                self.abort(fault)

    def _play(self, t: float, position: float) -> None:
        assert self._start is not None
        index = round((t - self._start) * self.plan.rate)
        if index >= len(self._answers.open_loop):
            self.phase, self.drive = Phase.FINISHED, 0.0
            return
        self.played += index > self._index
        self._index = index
        self.drive = answer(self._answers, index, position)

    def _fall(self) -> None:
        left = (self._end - self._time) / STOP_RAMP_S
        if left <= 0.0:
            self.abort(self.reason)
        else:
            self.drive = self._stop_drive * min(left, 1.0)
