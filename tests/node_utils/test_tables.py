"""Tables on a terminal."""

from __future__ import annotations

import pytest

from hydraulic_node_utils import tables


def test_signs_before_a_heading_set_its_column() -> None:
    made = tables.table("title", ("name", ">value", "|id", ">|count"), [("a", "1", "x", "2")], show_lines=True)
    assert [c.header for c in made.columns] == ["name", "value", "id", "count"]
    assert [c.justify for c in made.columns] == ["left", "right", "left", "right"]
    assert [c.no_wrap for c in made.columns] == [False, False, True, True]
    assert made.row_count == 1 and made.show_lines and made.title_justify == "left"


def test_what_looks_like_markup_is_printed_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    tables.console().print(tables.table("t", ("unit [m]",), [("[bold]",)]))
    printed = capsys.readouterr().out
    assert "unit [m]" in printed and "[bold]" in printed


def test_a_width_holds_where_there_is_no_terminal() -> None:
    assert (tables.console().width, tables.console(120).width) == (80, 120)
