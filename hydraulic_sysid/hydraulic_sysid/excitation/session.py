"""From states, diagnostics and requests to commands and events: what the excitation node does, without ROS."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

from hydraulic_interfaces.contract import ABORTED, EXCITATION_NODE, FINISHED, NAMESPACE, STARTED
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.plant_report import PlantReport
from hydraulic_sysid.excitation.applied import AppliedDriveCheck
from hydraulic_sysid.excitation.plan import Plan
from hydraulic_sysid.excitation.run import ExcitationRun, Phase

NOT_STARTED = "not started"
"""What is said of a plan that waited in vain for the plant to be ready for it."""


class Session:
    """Arms plans, starts each when the plant is ready for it, plays it, and reports how it ended.

    `emit` takes the events (JSON); `listeners` says how many subscribers the commands have; the plant is that of
    `namespace`. Times `now` are
    seconds of a steady clock: silence is measured there, so that a process which was held up for a moment,
    with its states still waiting, does not take itself for deserted.
    """

    def __init__(self, emit: Callable[[str], None], listeners: Callable[[], int], namespace: str = NAMESPACE) -> None:
        self._emit, self._listeners = emit, listeners
        self.state_timeout, self.applied_tolerance, self.listeners_needed = 0.5, 0.1, 1
        self.plant = PlantReport(namespace)
        self.armed: ExcitationRun | None = None
        self.run: ExcitationRun | None = None
        self.ended: Phase | None = None  # how the last run ended
        self.last_end = ""
        self._announced = False
        self._heard = -math.inf
        self._stamp_ns = self._started_ns = 0

    @property
    def busy(self) -> bool:
        """Whether a run is on or waits for the plant."""
        return self.run is not None or self.armed is not None

    @property
    def ended_badly(self) -> bool:
        """Whether nothing is on and the last run was aborted."""
        return self.ended is Phase.ABORTED and not self.busy

    def obstacle(self, now: float) -> str:
        """What a start must wait for; empty when nothing."""
        if now - self._heard > self.state_timeout:
            return "the state of the plant"
        count = self._listeners()
        if count < self.listeners_needed:
            return f"{self.listeners_needed} listeners to commands (there are {count})"
        if self.plant.disabled:
            return f"the plant to be enabled (it says: {self.plant.disabled})"
        source = self.plant.foreign_source(EXCITATION_NODE)
        return f"{source!r} to stop commanding" if source else ""

    def answer(self, sample: PlantSample, now: float) -> float | None:
        """The drive [V] that answers a state which came at `now`; None where there is nothing to say."""
        self._heard, self._stamp_ns = now, sample.stamp_ns
        if self.armed is not None and not self.obstacle(now):
            self._start(self.armed)
        run = self.run
        if run is None:
            return None
        drive = run.step((sample.stamp_ns - self._started_ns) * 1e-9, sample.position, sample.drive)
        if run.phase is not Phase.PLAYING:
            self._announce(run)
        if run.done:
            self.run = None
        return drive

    def silence(self, now: float) -> tuple[int, float] | None:
        """To be called while no state comes: a last command (stamp in ns, 0 V) once that has lasted too long."""
        age = now - self._heard
        run = self.run
        if run is None or not run.check_age(age):
            return None
        self._stamp_ns += round(age * 1e9)
        self._announce(run)
        self.run = None
        return self._stamp_ns, 0.0

    def diagnose(self, name: str, ok: bool, message: str, values: dict[str, str]) -> None:
        """Take a row of the diagnostics; a plant that is no longer enabled ends the run."""
        self.plant.update(name, ok, message, values)
        if self.run is not None and self.plant.disabled:
            self.run.abort("the plant is not enabled any more")

    def arm(self, plan: Plan) -> None:
        """Have `plan` ready: it starts with the first state for which there is no obstacle."""
        check = AppliedDriveCheck(self.applied_tolerance)
        self.armed = ExcitationRun(plan, state_timeout=self.state_timeout, applied_check=check)

    def stop(self, reason: str) -> bool:
        """End what is on or armed, on request; False when there was nothing."""
        was_busy, self.armed = self.busy, None
        if self.run is not None:
            self.run.stop(reason)
        return was_busy

    def _start(self, run: ExcitationRun) -> None:
        self.run, self.armed, self.ended = run, None, None
        self._announced, self._started_ns = False, self._stamp_ns
        self.plant.forget()
        self._emit(experiment_event(STARTED, run, self._started_ns, self._stamp_ns))

    def _announce(self, run: ExcitationRun) -> None:
        if self._announced or run.phase is Phase.STOPPING:
            return
        self._announced, self.ended = True, run.phase
        kind, reason = FINISHED, ""
        if run.phase is Phase.ABORTED:
            trouble = "" if run.requested else self.plant.trouble
            kind, reason = ABORTED, "; the plant says: ".join(filter(None, (run.reason, trouble)))
        self.last_end = f"{run.plan.name} {kind}" + (f": {reason}" if reason else "")
        self._emit(experiment_event(kind, run, self._started_ns, self._stamp_ns, reason))


def experiment_event(kind: str, run: ExcitationRun, started_ns: int, stamp_ns: int, reason: str = "") -> str:
    """One event: `kind` at `stamp_ns`, of the run that began with the state of `started_ns`.

    `kind` is STARTED, FINISHED or ABORTED of the contract.

    Keys: event, stamp_ns, started_ns (the same in all events of a run), reason (of an abort), samples and
    played (how many the plan has, and how many of them were commanded), plan (complete: `Plan.from_mapping`
    gives it back).
    """
    content = {
        "event": kind,
        "stamp_ns": stamp_ns,
        "started_ns": started_ns,
        "reason": reason,
        "samples": run.plan.time.size,
        "played": run.played,
        "plan": run.plan.as_mapping(),
    }
    return json.dumps(content, allow_nan=False, ensure_ascii=False)
