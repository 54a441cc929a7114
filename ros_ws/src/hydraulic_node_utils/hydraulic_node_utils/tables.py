"""Tables on a terminal, in the form that all verbs have."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table


def console(width: int | None = None) -> Console:
    """Standard output as it is, without markup; ``width`` is taken where it is no terminal (default 80)."""
    found = Console(file=sys.stdout, highlight=False, markup=False)
    if width is not None and not found.is_terminal:
        found.width = width
    return found


def table(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]] = (), **style: Any) -> Table:
    """A table with its title at the left.

    :param columns: headings; ``>heading`` is set to the right, ``|heading`` and ``>|heading`` are never wrapped
    :param style: further properties of `rich.table.Table`
    """
    made = Table(title=title, title_justify="left", **style)
    for heading in columns:
        right, text = heading.startswith(">"), heading.removeprefix(">")
        made.add_column(text.removeprefix("|"), justify="right" if right else "left", no_wrap=text.startswith("|"))
    for row in rows:
        made.add_row(*row)
    return made
