"""What `./bench doctor` reports: one finding per thing looked at."""

from __future__ import annotations

from dataclasses import dataclass

OK = "ok"
NOTE = "note"
MISSING = "missing"


@dataclass(frozen=True)
class Finding:
    """One line of the report.

    :param subject: what was looked at
    :param found: what is there
    :param remedy: how to get what is missing, or to improve it
    :param state: `ok`; `note`: the bench runs without it; `missing`: the bench does not run
    """

    subject: str
    found: str
    remedy: str = ""
    state: str = OK

    def lines(self) -> list[str]:
        """Text of the finding."""
        first = f"  {self.state:8}{self.subject:18}{self.found}"
        return [first, *(f"  {'':8}{'':18}-> {line}" for line in self.remedy.splitlines())]
