"""The excitation's row on `/diagnostics`."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray

from hydraulic_node_utils.nodes import diagnostics
from hydraulic_sysid.excitation import Session


def health(node: str, session: Session, waiting_for: str, now_ns: int) -> DiagnosticArray:
    """The row of `node` at `now_ns`: the run that is on, what a start waits for, or how the last run ended."""
    run = session.run
    values = {"last_run": session.last_end, "waiting_for": waiting_for}
    message = f"waiting for {waiting_for}" if waiting_for else session.last_end or "idle"
    if run is not None:
        message = f"{run.phase.value}: {run.plan.name}, {run.progress:.0%}"
        values |= {"plan": run.plan.name, "progress": f"{run.progress:.3f}", "drive_V": f"{run.drive:.4f}"}
    level = diagnostics.WARN if session.ended_badly else diagnostics.OK
    row = diagnostics.row(f"{node}: run", level, message, values, "excitation")
    return diagnostics.array(now_ns, row)
