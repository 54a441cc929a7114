"""The excitation's row on `/diagnostics`."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hydraulic_interfaces.contract import EXCITATION_NODE, absolute
from hydraulic_interfaces.conversions import to_time
from hydraulic_sysid.excitation import Session


def health(session: Session, waiting_for: str, now_ns: int) -> DiagnosticArray:
    """The row at `now_ns`: the run that is on, what a start waits for, or how the last run ended."""
    run = session.run
    values = {"last_run": session.last_end, "waiting_for": waiting_for}
    message = f"waiting for {waiting_for}" if waiting_for else session.last_end or "idle"
    if run is not None:
        message = f"{run.phase.value}: {run.plan.name}, {run.progress:.0%}"
        values |= {"plan": run.plan.name, "progress": f"{run.progress:.3f}", "drive_V": f"{run.drive:.4f}"}
    row = DiagnosticStatus(
        level=DiagnosticStatus.WARN if session.ended_badly else DiagnosticStatus.OK,
        name=f"{absolute(EXCITATION_NODE)}: run",
        message=message,
        hardware_id="excitation",
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    array = DiagnosticArray(status=[row])
    array.header.stamp = to_time(now_ns)
    return array
