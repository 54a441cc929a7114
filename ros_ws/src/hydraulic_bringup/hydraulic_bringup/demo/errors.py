"""What a demo tells its user when a step fails."""

from __future__ import annotations

from hydraulic_interfaces.errors import HydraulicError


class DemoError(HydraulicError):
    """A step failed. ``step`` which, ``why`` in one or more lines, ``remedy`` what to do about it."""

    exit_code = 1

    def __init__(self, step: str, why: str, remedy: str = "") -> None:
        super().__init__(f"failed at step {step!r}: {why}" + (f"\n{remedy}" if remedy else ""))
        self.step, self.why, self.remedy = step, why, remedy
