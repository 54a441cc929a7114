"""YAML from anywhere is a document or a YAMLError, and ends."""

from __future__ import annotations

import pytest
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from hydraulic_node_utils.yaml_text import load_yaml

BOMB = "a: &a [0, 0, 0, 0, 0, 0, 0, 0]\n" + "".join(
    f"{name}: &{name} [{', '.join(8 * [f'*{before}'])}]\n"
    for before, name in zip("abcdefghij", "bcdefghijk", strict=True)
)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: " + "[" * 1200, "nested too deeply"),
        ("a: 2001-99-99", "month"),
        ("a: " + "1" * 5000, "4300 digits"),
        ("a: !!int b", "invalid literal"),
        ("a: &a [*a]", "aliases make inf values"),
        ("a: &a {b: {c: *a}}", "aliases make inf values"),
        (BOMB, "aliases make .*; allowed are 1,000,000"),
        ("a: [", "expected"),
        ("a: \x00", "not allowed"),
    ],
    ids=["deep", "date", "digits", "tag", "cycle", "longer cycle", "bomb", "no YAML", "no text"],
)
def test_what_is_no_document_is_a_yaml_error(text: str, says: str) -> None:
    with pytest.raises(YAMLError, match=says):
        load_yaml(YAML(typ="safe"), text)


def test_a_document_is_read_with_its_aliases() -> None:
    assert load_yaml(YAML(typ="safe"), "a: &a {x: 1}\nb: [*a, *a]") == {"a": {"x": 1}, "b": [{"x": 1}, {"x": 1}]}
    assert load_yaml(YAML(typ="safe"), "") is None
