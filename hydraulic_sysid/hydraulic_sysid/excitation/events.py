"""The JSON events of a run on the topic `experiment`."""

from __future__ import annotations

import json

from hydraulic_sysid.excitation.run import ExcitationRun


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
