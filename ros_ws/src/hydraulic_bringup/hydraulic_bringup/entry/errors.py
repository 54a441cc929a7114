"""Errors of the entry: each says what failed, why, and what to do about it."""

from __future__ import annotations

import textwrap


class BenchError(Exception):
    """A step of `./bench` failed; exit code 1.

    :param what: which step failed, or what is missing
    :param why: the cause, where it is known (may be several lines: the end of a log)
    :param remedy: what the user can do
    """

    exit_code = 1

    def __init__(self, what: str, *, why: str = "", remedy: str = "") -> None:
        super().__init__(what)
        self.what, self.why, self.remedy = what, why, remedy

    def __str__(self) -> str:
        lines = [self.what]
        for label, text in (("why", self.why), ("do", self.remedy)):
            if text:
                lines.append(f"  {label + ':':5}" + textwrap.indent(text, " " * 7).lstrip())
        return "\n".join(lines)


class UsageError(BenchError):
    """The command line does not make sense; exit code 2."""

    exit_code = 2
