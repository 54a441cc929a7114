"""The manifest of a campaign: a verb, and the records, models and options that its cases combine.

As a YAML file, paths relative to it::

    verb: diagnose                    # of hydraulic_sysid; or "hydraulic_control evaluate"
    records: [bags/*, more/*.csv]     # patterns; each file or bag that one matches is a case of its own
    models: [sample_bench, my.yaml]   # patterns or names of presets
    options:                          # each entry a variation; keys as on the command line
      - {}
      - {segment: 0.3}

``records`` may also name groups, ``{left: [a.csv, b.csv]}``: the records of a group go into one case.
"""

from __future__ import annotations

import glob
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_node_utils.yaml_text import load_yaml

_KEYS = ("verb", "records", "models", "options")


class CampaignError(HydraulicError):
    """A manifest that makes no cases, a cluster that is not there, a folder that is taken."""


@dataclass(frozen=True)
class Manifest:
    """What a campaign combines: one case for each group of records, model and variation of options.

    ``records``: name → its paths; ``models``: name → file or preset; ``options``: name → options of the verb. Each may
    be empty: a verb that needs no record is called without one.
    """

    verb: str
    records: Mapping[str, Sequence[str]] = field(default_factory=dict)
    models: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def package(self) -> str:
        """Package of the verb."""
        return self.verb.split()[0] if " " in self.verb else "hydraulic_sysid"

    @property
    def name(self) -> str:
        """The verb without its package."""
        return self.verb.split()[-1]


def read_yaml(text: str) -> Any:
    """What a text in YAML says.

    :raises YAMLError: it is none.
    """
    return load_yaml(YAML(typ="safe", pure=True), text)


def load_manifest(path: Path) -> Manifest:
    """Read a manifest.

    :raises CampaignError: not readable, an unknown or missing key, a value of another form, or a pattern that matches
        nothing.
    """
    try:
        content = read_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise CampaignError(f"{path} is no manifest: {error}") from error
    if not isinstance(content, dict) or not isinstance(content.get("verb"), str) or not content["verb"].split():
        raise CampaignError(f"{path}: a manifest states verb: NAME; allowed besides: {', '.join(_KEYS[1:])}")
    strangers = sorted(str(key) for key in set(content) - set(_KEYS))
    if strangers:
        raise CampaignError(f"{path}: unknown keys {', '.join(strangers)}; allowed are {', '.join(_KEYS)}")
    where, base = str(path), path.parent
    return Manifest(
        content["verb"],
        record_groups(content.get("records") or [], base, where),
        model_files(_texts(content.get("models") or [], "models", where), base, where),
        variations(content.get("options") or [], where),
    )


def record_groups(patterns: Any, base: Path, where: str) -> dict[str, list[str]]:
    """Name → paths of the records of a case: a group by its name, or each path that a pattern matches.

    :raises CampaignError: another form, or a pattern that matches nothing.
    """
    if isinstance(patterns, dict):
        return {
            str(name): [p for t in _texts(texts, f"records: {name}", where) for p in _matches(t, base, where)]
            for name, texts in patterns.items()
        }
    paths = [p for t in _texts(patterns, "records", where) for p in _matches(t, base, where)]
    return {name: [path] for name, path in _named(paths).items()}


def model_files(patterns: Sequence[str], base: Path, where: str) -> dict[str, str]:
    """Name → model file; what matches no file and has no suffix is the name of a preset.

    :raises CampaignError: a pattern that matches nothing.
    """
    found: list[str] = []
    for text in patterns:
        preset = "." not in text and "/" not in text and not (base / text).exists()
        found += [text] if preset else _matches(text, base, where)
    return _named(found)


def variations(entries: Any, where: str) -> dict[str, dict[str, Any]]:
    """Name → options of one variation; its name says what it sets.

    :raises CampaignError: not a list of mappings.
    """
    if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
        raise CampaignError(f"{where}: options is a list of mappings, such as [{{}}, {{segment: 0.3}}]")
    return {
        ", ".join(f"{k}={v}" for k, v in e.items()) or "default": {str(k): v for k, v in e.items()} for e in entries
    }


def _texts(value: Any, key: str, where: str) -> list[str]:
    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not all(isinstance(t, str) for t in texts):
        raise CampaignError(f"{where}: {key} is {value!r}; allowed is a list of paths or patterns")
    return texts


def _matches(pattern: str, base: Path, where: str) -> list[str]:
    found = sorted(glob.glob(str(base / Path(pattern).expanduser()), recursive=True))
    if not found:
        raise CampaignError(f"{where}: nothing matches {pattern!r} in {base}")
    return found


def _named(paths: Sequence[str]) -> dict[str, str]:
    """Names that are as short as they can be: the last parts of a path in which it differs from all others."""
    unique = list(dict.fromkeys(paths))
    for parts in range(1, 64):
        names = ["/".join(Path(p).parts[-parts:]) for p in unique]
        if len(set(names)) == len(names):
            break
    return dict(zip(names, unique, strict=True)) if unique else {}
