"""Control word, status word and state machine of a CiA 408 servo valve.

States by the lower four bits of the status word, R (ready) M (active) H (hold) D (disabled): see `State`. The control
words 0, 1, 3, 7 ask for INIT, DISABLED, HOLD, ACTIVE; bit 3 resets a fault with its rising edge. 0000 means "not
ready" or "fault in INIT"; the word alone does not tell which.
"""

from __future__ import annotations

from enum import Enum, IntFlag


class Control(IntFlag):
    """Bits of the control word 0x6040."""

    DISABLED = 1
    HOLD = 2
    ACTIVE = 4
    RESET_FAULT = 8


class Status(IntFlag):
    """Bits of the status word 0x6041."""

    DISABLED = 1 << 0
    HOLD = 1 << 1
    ACTIVE = 1 << 2
    READY = 1 << 3
    LOCAL = 1 << 4
    RAMP_RUNNING = 1 << 9
    LIMIT = 1 << 10
    CONTROL_DEVIATION = 1 << 11
    RAMP_FROZEN = 1 << 15


class State(Enum):
    """State of the valve: the lower four bits of the status word; UNKNOWN stands for those that mean nothing."""

    INIT = 0b1000
    DISABLED = 0b1001
    HOLD = 0b1011
    ACTIVE = 0b1111
    FAULT_DISABLED = 0b0001
    FAULT_HOLD = 0b0011
    FAULT_REACTION = 0b0111
    NOT_READY = 0b0000
    UNKNOWN = -1

    @property
    def faulty(self) -> bool:
        """Whether the valve says that it has a fault."""
        return self in (State.FAULT_DISABLED, State.FAULT_HOLD, State.FAULT_REACTION)


CONTROL_WORDS = {State.INIT: 0, State.DISABLED: 1, State.HOLD: 3, State.ACTIVE: 7}
"""Control word that asks for a state; in the order in which they are stepped through."""

_LADDER = tuple(CONTROL_WORDS)
_BY_BITS = {state.value: state for state in State}
_REMARKS = (Status.LOCAL, Status.RAMP_RUNNING, Status.LIMIT, Status.CONTROL_DEVIATION, Status.RAMP_FROZEN)


def state_of(status: int) -> State:
    """State in a status word (16 bits)."""
    return _BY_BITS.get(status & 0xF, State.UNKNOWN)


def describe(status: int) -> str:
    """A status word in words: state and remarks."""
    remarks = [str(bit.name).lower().replace("_", " ") for bit in _REMARKS if status & bit]
    return ", ".join([f"{state_of(status).name} (0x{status:04X})", *remarks])


class StateMachine:
    """Leads the valve to a state and sees to it that it stays there; `patience` [s] per step.

    Up goes one step at a time, each seen in the status word before the next is asked for; down goes at once (the valve
    carries out what lies between). Send `control` in every cycle and hand every status word to `advance`. `problem`
    says what went wrong; the machine then asks for DISABLED and takes no other goal until `reset`.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self.status: int | None = None
        self.problem = ""
        self.goal = State.INIT
        self._step = State.INIT
        self._seen = False
        self._resetting = False
        self.control = 0
        self._deadline = float("inf")

    @property
    def arrived(self) -> bool:
        """Whether the valve is in the state that was asked for."""
        return self._seen and self._step is self.goal and not self.problem and not self._resetting

    @property
    def active(self) -> bool:
        """Whether the valve follows its setpoint, as it was asked to."""
        return self.arrived and self.goal is State.ACTIVE

    @property
    def state(self) -> State:
        """State that the valve has last told."""
        return State.UNKNOWN if self.status is None else state_of(self.status)

    def ask(self, goal: State, now: float) -> None:
        """Lead the valve to `goal` from now on; `now` in s on any clock that only goes forward."""
        if goal not in CONTROL_WORDS:
            raise ValueError(f"goal is {goal.name}; allowed: {', '.join(state.name for state in _LADDER)}")
        if self.problem or goal is self.goal:
            return
        self.goal = goal
        if _LADDER.index(goal) < _LADDER.index(self._step):
            self._ask(goal, now)
        elif self._seen:
            self._up(now)

    def reset(self, now: float) -> None:
        """Forget the problem, reset the fault in the valve, and lead it to DISABLED."""
        self.problem = ""
        self.goal = State.DISABLED
        self._ask(State.DISABLED, now)
        self._resetting = True

    def fail(self, problem: str) -> None:
        """Ask for DISABLED and stay there, because of `problem`; the first one is kept."""
        self.problem = self.problem or problem
        self.goal = self._step = State.DISABLED
        self.control = CONTROL_WORDS[State.DISABLED]
        self._seen = self._resetting = False

    def advance(self, status: int, now: float) -> None:
        """Take the status word that answers the last control word."""
        self.status = status
        state = state_of(status)
        if self.problem:
            return
        if self._resetting:
            self._reset_step(state, now)
        elif state.faulty:
            self.fail(f"valve reports a fault: {describe(status)}")
        elif status & Status.LOCAL and self.goal is State.ACTIVE:
            self.fail(f"valve is under local control: {describe(status)}")
        elif state is self._step:
            self._seen = True
            if self._step is not self.goal:
                self._up(now)
        elif self._seen:
            self.fail(f"valve left {self._step.name} by itself: {describe(status)}")
        elif now > self._deadline:
            self._late(f"control word 0x{self.control:04X}")

    def _reset_step(self, state: State, now: float) -> None:
        if not self.control & Control.RESET_FAULT and state not in (State.INIT, State.DISABLED):
            self.control |= Control.RESET_FAULT  # the cycle before carried the bit as 0
        elif state is State.DISABLED:
            self.control = CONTROL_WORDS[State.DISABLED]
            self._resetting, self._seen = False, True
        elif now > self._deadline:
            self._late("the fault reset")

    def _late(self, what: str) -> None:
        self.fail(
            f"valve is {describe(self.status or 0)} {self._patience:g} s after {what}; expected {self._step.name}"
        )

    def _up(self, now: float) -> None:
        self._ask(_LADDER[_LADDER.index(self._step) + 1], now)

    def _ask(self, step: State, now: float) -> None:
        self._step, self._seen, self._resetting = step, False, False
        self.control = CONTROL_WORDS[step]
        self._deadline = now + self._patience
