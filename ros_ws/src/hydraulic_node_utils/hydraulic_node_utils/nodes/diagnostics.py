"""Rows on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from hydraulic_interfaces.conversions import to_time

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def row(name: str, level: bytes, message: str, values: Mapping[str, object], hardware_id: str = "") -> DiagnosticStatus:
    """One row: ``name`` says whose it is and of what (``/actuator/plant: timing``)."""
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id=hardware_id, values=pairs)


def array(now_ns: int, *rows: DiagnosticStatus) -> DiagnosticArray:
    """The message with those rows."""
    message = DiagnosticArray(status=list(rows))
    message.header.stamp = to_time(now_ns)
    return message
