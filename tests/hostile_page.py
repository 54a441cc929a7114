"""What a page must stand: a result in which every text wants to become markup."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hydraulic_sysid import report
from hydraulic_sysid.data.results import ResultError
from hydraulic_sysid.report import render

HOSTILE = """<script>alert(1)</script>"'&hostile"""
_REPORT = Path(report.__file__).parent


@patch("hydraulic_sysid.report.page.get_plotlyjs", lambda: "")  # 5 MB in which nothing of a document stands
def assert_cannot_inject(document: dict[str, Any]) -> None:
    """Every text of the document, and every key that is such a text, is made hostile: the page keeps its elements.

    Words that templates and figures themselves contain (kinds of verdict, channels) decide what is shown. They are
    made hostile one by one, and may then be refused. So is every entry that is empty here and a text elsewhere.
    """
    document = {**_thin(document), "software": {"python": "3"}}
    texts = {text for text in _texts({**document, "schema": ""}) if text}
    words = texts & _vocabulary()
    shown = _elements(render([document]))
    page = render([_renamed(document, texts - words)])
    assert HOSTILE not in page and "<script>alert(1)" not in page and "\"'&hostile" not in page
    assert "hostile" in page
    assert _elements(page) == shown
    one_by_one = {word: _renamed(document, {word}) for word in words}
    one_by_one |= {f"empty {key}": _filled(document, key) for key in _empty(document)}
    for what, changed in one_by_one.items():
        try:
            page = render([changed])
        except ResultError:
            continue  # refused
        assert "<script>alert(1)" not in page and "\"'&hostile" not in page, what


def _thin(value: Any) -> Any:
    """The document without most of its long arrays of numbers."""
    if isinstance(value, dict):
        return {key: _thin(item) for key, item in value.items()}
    if isinstance(value, list):
        numbers = len(value) > 100 and not isinstance(value[0], str | list | dict)
        return [_thin(item) for item in (value[:100] if numbers else value)]
    return value


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _texts(item)


def _empty(value: Any, key: str = "") -> set[str]:
    """Keys whose value is null somewhere."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else ((key, item) for item in value)
        return {found for name, item in items for found in _empty(item, name)}
    return {key} if value is None else set()


def _filled(value: Any, wanted: str, key: str = "") -> Any:
    """The same with the payload for every null of that key."""
    if isinstance(value, dict):
        return {name: _filled(item, wanted, name) for name, item in value.items()}
    if isinstance(value, list):
        return [_filled(item, wanted, key) for item in value]
    return HOSTILE if value is None and key == wanted else value


def _renamed(value: Any, texts: set[str]) -> Any:
    """The same with the payload after each of these texts, where they are keys too; schemas are kept."""
    if isinstance(value, dict):
        return {
            key + HOSTILE if key in texts else key: item if key == "schema" else _renamed(item, texts)
            for key, item in value.items()
        }
    if isinstance(value, list):
        return [_renamed(item, texts) for item in value]
    return value + HOSTILE if value in texts and isinstance(value, str) else value


def _vocabulary() -> set[str]:
    """Every word in the sources of the report, and every quoted text."""
    sources = [p.read_text(encoding="utf-8") for p in _REPORT.rglob("*") if p.suffix in (".py", ".j2")]
    return {word for source in sources for word in re.findall(r'\w+|(?<=")[^"\n]+(?=")', source)}


class _Elements(HTMLParser):
    """The elements of a page in order, with the names of their attributes."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, tuple[str, ...]]] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, tuple(name for name, _ in attributes)))


def _elements(page: str) -> list[tuple[str, tuple[str, ...]]]:
    parser = _Elements()
    parser.feed(page)
    return parser.found
