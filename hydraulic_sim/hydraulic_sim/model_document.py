"""The YAML document of a model: the one it was read from, changed only where the model differs from it."""

from __future__ import annotations

import copy
import os
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import CommentMark
from ruamel.yaml.tokens import CommentToken

from .effect import Parameter
from .model import Entry, Model, check_within
from .units import to_si

FORMAT = "hydraulic-model-1"


def document(model: Model, target: Path) -> CommentedMap:
    """What `model_file.save_model` writes to ``target``. Values of effects that are off are left out."""
    top = copy.deepcopy(model.document) if isinstance(model.document, CommentedMap) else CommentedMap()
    top["format"] = FORMAT
    top["name"] = model.name
    if model.description or "description" in top:
        top["description"] = model.description
    top["plant"] = model.kind
    parameters = _mapping(top, "parameters")
    effects = _mapping(top, "effects")
    for name in [n for n in effects if n not in model.effects and not model.library[n].always_on]:
        _remove(effects, name, top, "effects")
    for name in model.effects:
        if effects.get(name) is None:
            effects[name] = CommentedMap()
    for name in [n for n in parameters if n not in model.entries]:
        _remove(parameters, name, top, "parameters")
    for owner, node in effects.items():
        for name in [n for n in node or () if f"{owner}.{n}" not in model.entries]:
            _remove(node, name, effects, owner)
    for key, entry in model.entries.items():
        owner, _, name = key.rpartition(".")
        if owner and owner not in effects and not model.library[owner].always_on:
            continue
        _write_entry(_mapping(effects, owner) if owner else parameters, name, key, model.parameter(key), entry)
    files = [os.path.relpath(f, target.resolve().parent) for f in model.user_effects]
    if files != list(top.get("user_effects") or ()):
        top["user_effects"] = files
    _write_history(top, [plain(record) for record in model.history])
    return top


def plain(value: Any) -> Any:
    """A value of the history in types that YAML has: numbers of numpy and arrays become those of Python."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    return value


def _mapping(node: CommentedMap, key: str) -> CommentedMap:
    if not isinstance(node.get(key), CommentedMap):
        node[key] = CommentedMap()
    return node[key]


def _write_history(top: CommentedMap, history: list[object]) -> None:
    """Lines are only added as a rule; those that are there keep their comments."""
    old = top.get("history")
    written = [plain(record) for record in old] if isinstance(old, CommentedSeq) else []
    if not written or written != history[: len(written)]:
        if history != written or old is None:
            top["history"] = history
        return
    if len(history) > len(written):
        old.fa.set_block_style()
        old.extend(history[len(written) :])


def _write_entry(node: CommentedMap, name: str, key: str, record: Parameter, entry: Entry) -> None:
    check_within(key, record, entry.value, entry.bounds)
    old = node.get(name)
    kept = old["value"] if isinstance(old, CommentedMap) else old
    value = kept if old is not None and to_si(kept, record.unit, key) == entry.value else quantity(entry.value, record)
    extra: dict[str, object] = {
        "source": entry.source or None,
        "fit": None if entry.free is None else ("free" if entry.free else "fixed"),
        "bounds": None if entry.bounds is None else [quantity(b, record) for b in entry.bounds],
        "standard_error": None if entry.standard_error is None else quantity(entry.standard_error, record),
        "printed": entry.printed,
        "note": entry.note,
    }
    if not isinstance(old, CommentedMap):
        if not any(v is not None for v in extra.values()):
            if value != old:
                node[name] = value
            return
        old = node[name] = CommentedMap()
    if old.get("value") != value:
        old["value"] = value
    for field_name, now in extra.items():
        if now is None:
            if old.get(field_name) is not None:
                _remove(old, field_name, node, name)
        elif field_name not in old or not _same(old[field_name], now, record, key):
            old[field_name] = now


def _same(written: object, now: object, record: Parameter, key: str) -> bool:
    """Whether a field already says so, maybe in another unit."""
    if isinstance(written, CommentedSeq) and isinstance(now, list):
        return [to_si(b, record.unit, key) for b in written] == [to_si(b, record.unit, key) for b in now]
    return str(written) == now


def quantity(value: float, record: Parameter) -> str | float:
    """A value with its unit, in as many digits as it takes to read the same number again."""
    number = float(value)
    if record.unit == "1":
        return number
    short = f"{number:.10g}"
    return f"{short if float(short) == number else repr(number)} {record.unit}"


def _remove(node: CommentedMap, key: str, parent: CommentedMap, parent_key: str) -> None:
    """Delete a key of ``node`` (itself ``parent[parent_key]``), but keep the comment lines behind it.

    The reader hangs those on the last leaf before them, though they speak of what follows.
    """
    behind = _comment_behind(node, key)
    keys = list(node)
    earlier = keys[: keys.index(key)]
    del node[key]
    node.ca.items.pop(key, None)
    if not node:
        node.fa.set_flow_style()  # an empty block has no form but {}
    if behind:
        _append_comment(*(_last_leaf(node, earlier[-1]) if earlier else (parent, parent_key)), behind)


def _last_leaf(node: CommentedMap | CommentedSeq, key: str | int) -> tuple[CommentedMap | CommentedSeq, str | int]:
    value = node[key]
    if isinstance(value, (CommentedMap, CommentedSeq)) and len(value) and not value.fa.flow_style():
        return _last_leaf(value, list(value)[-1] if isinstance(value, CommentedMap) else len(value) - 1)
    return node, key


def _comment_behind(node: CommentedMap, key: str) -> str:
    """The comment lines after a key's last leaf, without the one on its own line."""
    place, last = _last_leaf(node, key)
    token = (place.ca.items.get(last) or [None] * 4)[_slot(place)]
    return token.value.partition("\n")[2] if token is not None else ""


def _append_comment(place: CommentedMap | CommentedSeq, key: str | int, text: str) -> None:
    items = place.ca.items.setdefault(key, [None] * 4)
    token = items[_slot(place)]
    if token is None:
        items[_slot(place)] = CommentToken("\n" + text, CommentMark(0))
    else:
        token.value += text


def _slot(place: CommentedMap | CommentedSeq) -> int:
    """Where the reader keeps what follows a value."""
    return 2 if isinstance(place, CommentedMap) else 0
