"""The controller's row on `/diagnostics`."""

from __future__ import annotations

from collections import deque

from diagnostic_msgs.msg import DiagnosticArray

from hydraulic_control.lockstep import ReferenceLockstep
from hydraulic_control.session import ControlSession
from hydraulic_node_utils.nodes import diagnostics
from hydraulic_node_utils.nodes.diagnostics import ERROR, OK, WARN


class ControllerHealth:
    """Builds the diagnostics; a fault raises the level in the message after it."""

    def __init__(self, node: str, session: ControlSession) -> None:
        self._name, self._session = f"{node}: loop", session
        self._seen = 0
        self._answered = 0
        self._then_ns = 0
        self.scheduling = "normal"
        self.lockstep: ReferenceLockstep | None = None
        self.latencies: deque[float] = deque(maxlen=2000)

    def message(self, state: str, now_ns: int) -> DiagnosticArray:
        """The row at `now_ns`; `state` is the lifecycle state."""
        session = self._session
        refused = sum(session.refusals.values())
        more, self._seen = refused - self._seen, refused
        elapsed = max((now_ns - self._then_ns) * 1e-9, 1e-9)
        rate, self._then_ns = (session.answered - self._answered) / elapsed, now_ns
        self._answered = session.answered
        late = sorted(self.latencies)
        values: dict[str, object] = {
            "lifecycle": state,
            "controller": session.controller.values["controller"],
            "drive_V": f"{session.controller.drive:.4f}",
            "error_m": f"{session.error:.6f}",
            "reference_m": "none" if session.reference is None else f"{session.reference.position:.6f}",
            "answered": session.answered,
            "rate_Hz": f"{rate:.1f}",
            "scheduling": self.scheduling,
            "last_trouble": session.trouble,
            **{refusal.name.lower(): count for refusal, count in session.refusals.items()},
        }
        if late:
            values["latency_p50_ms"] = f"{late[len(late) // 2] * 1e3:.4f}"
            values["latency_p99_ms"] = f"{late[int(0.99 * (len(late) - 1))] * 1e3:.4f}"
        if self.lockstep:
            values["without_reference"] = self.lockstep.given_up
        level, text = OK, f"{state}, {rate:.0f} Hz"
        if more:
            level, text = WARN, session.trouble
        elif state == "active" and rate == 0.0:
            level, text = ERROR, "no state can be answered: drive is 0 V"
        row = diagnostics.row(self._name, level, text, values, "controller")
        return diagnostics.array(now_ns, row)
