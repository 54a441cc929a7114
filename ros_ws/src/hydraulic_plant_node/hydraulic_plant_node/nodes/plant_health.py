"""The plant's rows on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hydraulic_node_utils.nodes import diagnostics
from hydraulic_node_utils.nodes.diagnostics import ERROR, OK, WARN
from hydraulic_plant_node.command_gate import CommandGate, Verdict
from hydraulic_plant_node.nodes.notices import Counters
from hydraulic_plant_node.plant_backend import PlantBackend
from hydraulic_plant_node.plant_loop import PlantLoop

# A wall clock set by more than this makes commands look stale and records inconsistent.
_CLOCK_STEP_S = 0.01


class PlantHealth:
    """Builds the diagnostics; a counter that moved since the last message raises the level once."""

    def __init__(self, name: str, gate: CommandGate, backend: PlantBackend) -> None:
        self._name, self._gate, self._backend = name, gate, backend
        self._counters = Counters()

    def urgent(self) -> tuple[object, ...]:
        """Changes of this value are worth a message at once."""
        gate = self._gate
        refused = sum(count for verdict, count in gate.counts.items() if verdict is not Verdict.ACCEPTED)
        return gate.enabled, gate.stop_reason, gate.timeouts, gate.source, bool(refused), gate.rivalled

    def message(
        self, state: str, loop: PlantLoop | None, error: str, now_ns: int, not_heard: str = ""
    ) -> DiagnosticArray:
        """The diagnostics now.

        `state` is the lifecycle state, `error` what made the node leave `active`, `not_heard` whose commands do not
        come.
        """
        timing = [self._timing(loop)] if loop is not None else []
        return diagnostics.array(
            now_ns, self._plant(state, error), self._command(state, loop, now_ns, not_heard), *timing
        )

    def _plant(self, state: str, error: str) -> DiagnosticStatus:
        gate = self._gate
        values = {
            "lifecycle": state,
            "enabled": gate.enabled,
            "emergency_stop": gate.stopped,
            "stop_reason": gate.stop_reason,
            "fault": error or self._backend.fault,
            **self._backend.report(),
        }
        if error or self._backend.fault:
            return self._status("plant", ERROR, error or self._backend.fault, values)
        if gate.stopped:
            return self._status("plant", ERROR, f"stopped until reset: {gate.stop_reason}", values)
        if self._backend.warning:
            return self._status("plant", WARN, self._backend.warning, values)
        text = f"{state}, {'enabled' if gate.enabled else 'not enabled'}"
        if self._backend.unprotected and state != "unconfigured":
            return self._status("plant", WARN, f"{text}, without {', '.join(self._backend.unprotected)}", values)
        return self._status("plant", OK, text, values)

    def _command(self, state: str, loop: PlantLoop | None, now_ns: int, not_heard: str) -> DiagnosticStatus:
        gate = self._gate
        counts = {verdict.name.lower(): gate.counts[verdict] for verdict in Verdict}
        values = {
            "source": gate.source,
            "age_s": f"{gate.age(now_ns):.4f}",
            "applied_drive_V": f"{loop.drive if loop else 0.0:.4f}",
            "watchdog_s": f"{gate.watchdog:g}",
            "timeouts": gate.timeouts,
            "last_problem": gate.last_problem,
            "second_publisher_of": gate.rivalled,
            "not_heard": not_heard,
            **counts,
        }
        braked = 0
        if limits := gate.limits:
            values |= {"allowed_V": f"{limits.allowed():.4f}", "braked": limits.braked, "slewed": limits.slewed}
            braked = self._counters.moved("braked", limits.braked)
        timeouts = self._counters.moved("timeouts", gate.timeouts)
        problems = self._counters.moved("problems", sum(counts.values()) - counts["accepted"])
        if timeouts:
            message = f"watchdog: no command for {gate.watchdog:g} s, drive is 0 V"
            return self._status("command", WARN, message, values)
        if problems:
            return self._status("command", WARN, f"{problems} commands {gate.last_problem}", values)
        if not_heard:
            return self._status("command", WARN, not_heard, values)
        if braked:
            return self._status("command", WARN, f"{braked} drives limited before the end of travel", values)
        if state == "active" and gate.enabled and not gate.source:
            return self._status("command", WARN, "no command: drive is 0 V", values)
        return self._status("command", OK, f"obeys {gate.source!r}" if gate.source else "no source", values)

    def _timing(self, loop: PlantLoop) -> DiagnosticStatus:
        report = loop.monitor.report()
        step = loop.wall_clock_step()
        values = {
            "rate_Hz": f"{report.rate:.2f}",
            "jitter_p50_ms": f"{report.jitter_p50 * 1e3:.4f}",
            "jitter_p99_ms": f"{report.jitter_p99 * 1e3:.4f}",
            "jitter_max_ms": f"{report.jitter_max * 1e3:.4f}",
            "run_jitter_p50_ms": f"{report.run_jitter_p50 * 1e3:.4f}",
            "run_jitter_p99_ms": f"{report.run_jitter_p99 * 1e3:.4f}",
            "run_jitter_max_ms": f"{report.run_jitter_max * 1e3:.4f}",
            "lateness_max_ms": f"{report.lateness_max * 1e3:.4f}",
            "samples": loop.samples,
            "lost": loop.lost,
            "overruns": report.overruns,
            "skipped": report.skipped,
            "wall_clock_step_s": f"{step:.4f}",
            "scheduling": loop.scheduling if loop.lockstep is None else "lockstep",
            "unanswered": loop.lockstep.given_up if loop.lockstep else 0,
        }
        skipped = self._counters.moved("skipped", report.skipped)
        overruns = self._counters.moved("overruns", report.overruns)
        if skipped:
            return self._status("timing", ERROR, f"{skipped} sampling instants skipped", values)
        if lost := self._counters.moved("lost", loop.lost):
            return self._status("timing", WARN, f"{lost} cycles without a sample", values)
        if loop.lockstep and (given_up := self._counters.moved("unanswered", loop.lockstep.given_up)):
            return self._status("timing", WARN, f"{given_up} samples without an answer", values)
        if abs(step) > _CLOCK_STEP_S:
            message = f"wall clock was set by {step:.3f} s: re-activate to stamp with the new time"
            return self._status("timing", WARN, message, values)
        if overruns:
            return self._status("timing", WARN, f"{overruns} deadlines overrun", values)
        return self._status("timing", OK, f"{report.rate:.1f} Hz", values)

    def _status(self, part: str, level: bytes, message: str, values: Mapping[str, Any]) -> DiagnosticStatus:
        return diagnostics.row(f"{self._name}: {part}", level, message, values, self._backend.hardware_id)
