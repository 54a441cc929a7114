"""YAML that may come from anywhere: whatever stands in it, it is a document or a `YAMLError`."""

from __future__ import annotations

from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

_MOST = 1_000_000
"""Values in a document, those behind an alias counted as often as it stands there."""


def load_yaml(yaml: YAML, text: str) -> Any:
    """What ``yaml`` reads in a text.

    :raises YAMLError: no YAML, a value that its type cannot have, brackets without end, or aliases without end.
    """
    try:
        document = yaml.load(text)
    except YAMLError:
        raise
    except RecursionError:
        raise YAMLError("nested too deeply") from None
    except Exception as error:  # the reader lets many kinds through: of dates, of long numbers, of tags
        raise YAMLError(f"{type(error).__name__}: {error}") from None
    if (size := _size(document)) > _MOST:
        raise YAMLError(f"aliases make {size:.3g} values of it; allowed are {_MOST:,}")
    return document


def _size(document: Any) -> float:
    """Number of values in a document; infinite where it contains itself."""
    sizes: dict[int, float] = {}
    open_ones: set[int] = set()
    stack: list[tuple[Any, bool]] = [(document, False)]
    while stack:
        value, closing = stack.pop()
        inner = _inner(value)
        if closing:
            open_ones.discard(id(value))
            sizes[id(value)] = 1.0 + sum(sizes.get(id(one), 1.0) for one in inner)
        elif inner and id(value) in open_ones:
            return float("inf")
        elif inner and id(value) not in sizes:
            open_ones.add(id(value))
            stack.append((value, True))
            stack.extend((one, False) for one in inner)
    return sizes.get(id(document), 1.0)


def _inner(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return [*value.keys(), *value.values()]
    return list(value) if isinstance(value, list | tuple | set) else []
