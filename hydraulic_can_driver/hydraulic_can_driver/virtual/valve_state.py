"""The device state machine of a CiA 408 valve, as the device itself goes through it."""

from __future__ import annotations

from enum import Enum

DISABLED_BIT, HOLD_BIT, ACTIVE_BIT, RESET_BIT = 0x1, 0x2, 0x4, 0x8
"""Bits of the control word 0x6040; in the status word 0x6041 the last is "ready"."""


class State(Enum):
    """States, each with the low four bits that the status word shows in it (R M H D)."""

    NOT_READY = 0b0000, "not ready"
    INIT = 0b1000, "init"
    DISABLED = 0b1001, "disabled"
    HOLD = 0b1011, "hold"
    ACTIVE = 0b1111, "active"
    FAULT_INIT = 0b0000, "fault init"
    FAULT_DISABLED = 0b0001, "fault disabled"
    FAULT_HOLD = 0b0011, "fault hold"
    FAULT_REACTION = 0b0111, "fault reaction"

    def __init__(self, bits: int, label: str) -> None:
        self.bits, self.label = bits, label


LADDER = (State.INIT, State.DISABLED, State.HOLD, State.ACTIVE)
_FAULTED = {
    State.INIT: State.FAULT_INIT,
    State.DISABLED: State.FAULT_DISABLED,
    State.HOLD: State.FAULT_HOLD,
    State.ACTIVE: State.FAULT_REACTION,
}
_RESET = {
    State.FAULT_INIT: State.INIT,
    State.FAULT_DISABLED: State.DISABLED,
    State.FAULT_HOLD: State.HOLD,
}


def wanted(word: int) -> State:
    """The state that a control word asks for: as far up the ladder as its bits are set without a gap."""
    height = 0
    for bit in (DISABLED_BIT, HOLD_BIT, ACTIVE_BIT):
        if not word & bit:
            break
        height += 1
    return LADDER[height]


class StateMachine:
    """Follows control words; `advance` is called once per cycle.

    Intermediate transitions are carried out in one cycle: a word that asks for ACTIVE in INIT passes DISABLED and HOLD.
    After a fault the valve becomes active again only after a word without the active bit.
    """

    def __init__(self) -> None:
        self.state = State.NOT_READY
        self.cause = ""
        self._word = 0
        self._armed = True

    @property
    def faulty(self) -> bool:
        """Whether it is in one of the fault states."""
        return self.state in _RESET or self.state is State.FAULT_REACTION

    def ready(self) -> None:
        """The self-test after power-on is over."""
        if self.state is State.NOT_READY:
            self.state = State.INIT

    def fault(self, cause: str) -> None:
        """Something is wrong; where the valve is active it first brings the spool back."""
        self.cause = cause
        self._armed = False
        self.state = _FAULTED.get(self.state, self.state)

    def advance(self, word: int, cause_lasts: bool) -> tuple[State, ...]:
        """Take a control word; the states that were passed through, in their order."""
        reset = bool(word & ~self._word & RESET_BIT)
        self._word = word
        if not word & ACTIVE_BIT:
            self._armed = True
        before = self.state
        if before is State.NOT_READY:
            return ()
        if before is State.FAULT_REACTION:
            self.state = State.FAULT_HOLD
        elif before is State.FAULT_HOLD and not word & HOLD_BIT:
            self.state = State.FAULT_DISABLED
        if self.faulty:
            if reset and not cause_lasts and self.state in _RESET:
                self.state, self.cause = _RESET[self.state], ""
            return (self.state,) if self.state is not before else ()
        return self._climb(wanted(word))

    def _climb(self, goal: State) -> tuple[State, ...]:
        if goal is State.ACTIVE and not self._armed:
            goal = State.HOLD
        here, there = LADDER.index(self.state), LADDER.index(goal)
        passed = LADDER[here + 1 : there + 1] if there > here else LADDER[there:here][::-1]
        self.state = goal
        return tuple(passed)
