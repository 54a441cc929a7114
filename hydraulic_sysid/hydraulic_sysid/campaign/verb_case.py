"""Cases that are calls of a verb, as on the command line."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import io
import json
from collections.abc import Iterable, Mapping
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hydraulic_node_utils import cli
from hydraulic_sysid.campaign.manifest import CampaignError, Manifest
from hydraulic_sysid.campaign.outcome import Case, CaseError, digest

LOG = "log.txt"
_DEPTH, _LONGEST = 4, 8  # of what a row takes from a document: nesting, and members of a list
_CODE = ("hydraulic_sim", "hydraulic_sysid", "hydraulic_control")


def verb_cases(manifest: Manifest) -> list[Case]:
    """One case for each group of records, model and variation of options.

    Its key is a hash of the verb, its options, the content of its files and the code.

    :raises CampaignError: no such verb, or nothing to combine.
    """
    package, verb = manifest.package, manifest.name
    known = cli.verbs(package) if package in _CODE and find_spec(package) else {}
    if verb not in known or verb == "campaign":
        offered = ", ".join(sorted(set(known) - {"campaign"})) or f"none in {package!r} (packages: {', '.join(_CODE)})"
        raise CampaignError(f"there is no verb {manifest.verb!r}; there are {offered}")
    records = manifest.records or {"": []}
    models = manifest.models or {"": ""}
    options = manifest.options or {"default": {}}
    cases = []
    for record, paths in records.items():
        for model, file in models.items():
            for variation, values in options.items():
                call = [*_flag("record", list(paths)), *_flag("model", file), *_arguments(values)]
                inputs = {
                    "verb": manifest.verb,
                    "call": [*_arguments(values), *([] if Path(file).exists() else [file])],
                    "records": [content(p) for p in paths],
                    "model": content(file) if Path(file).exists() else "",
                    "code": code(),
                }
                labels = {"record": record, "model": model, "options": variation}
                cases.append(Case(digest(inputs), labels, (package, verb, call)))
    return cases


def _flag(name: str, value: Any) -> list[str]:
    if value is True:
        return [f"--{name}"]
    if value in (None, False, "", []):
        return []
    return [f"--{name}", *(str(v) for v in (value if isinstance(value, list) else [value]))]


def _arguments(values: Mapping[str, Any]) -> list[str]:
    """Options as on the command line; the option ``arguments`` lists what stands without a name."""
    plain = values.get("arguments", [])
    flags = [a for name, value in values.items() if name != "arguments" for a in _flag(name, value)]
    return [*(str(v) for v in (plain if isinstance(plain, list) else [plain])), *flags]


@cache
def content(path: str) -> str:
    """Hash of a file, or of all files in a folder with their names."""
    place = Path(path)
    files = sorted(f for f in place.rglob("*") if f.is_file()) if place.is_dir() else [place]
    total = hashlib.sha256()
    for file in files:
        total.update(f"{file.relative_to(place) if place.is_dir() else file.name}\0".encode())
        with file.open("rb") as stream:
            for block in iter(lambda: stream.read(1 << 20), b""):
                total.update(block)
    return total.hexdigest()


@lru_cache(maxsize=1)
def code() -> str:
    """Hash of the packages that the verbs are made of."""
    total = hashlib.sha256()
    for package in _CODE:
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for file in sorted(Path(folder).rglob("*.py")):
                total.update(file.read_bytes())
    return total.hexdigest()[:12]


def work(call: tuple[str, str, list[str]], place: Path) -> dict[str, Any]:
    """Call a verb with the case's folder as ``--out``; the figures of its result as a row.

    In the call's arguments, ``{out}`` stands for the case's folder. What the verb prints is kept in the folder.

    :raises CaseError: the verb ended with bad input; the text is its own.
    """
    package, verb, arguments = call
    place.mkdir(parents=True, exist_ok=True)
    argv = [a.replace("{out}", str(place)) for a in arguments]
    if package == "hydraulic_sysid" and "--out" not in argv:
        argv += ["--out", str(place)]
    said, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        exit_code = int(importlib.import_module(f"{package}.verbs.{verb}").main(argv))
    (place / LOG).write_text(f"{said.getvalue()}{complained.getvalue()}", encoding="utf-8")
    if exit_code not in (cli.OK, cli.NEGATIVE):
        raise CaseError(complained.getvalue().strip() or f"{package} {verb} ended with exit code {exit_code}")
    return {"exit_code": exit_code, **_figures(place / f"{verb}.json", said.getvalue())}


def _figures(file: Path, printed: str) -> dict[str, Any]:
    """Figures of the result's document, or of what was printed where that is one."""
    text = file.read_text(encoding="utf-8") if file.exists() else printed
    try:
        document = json.loads(text)
    except ValueError:
        return {}
    return dict(flat(document)) if isinstance(document, dict) else {}


def flat(value: Any, name: str = "", depth: int = _DEPTH) -> Iterable[tuple[str, Any]]:
    """Numbers, texts and short lists of such in a document, under their path with dots."""
    if isinstance(value, dict) and depth > 0:
        for key, inner in value.items():
            if name or key not in ("schema", "created", "software", "records", "settings"):
                yield from flat(inner, f"{name}.{key}" if name else str(key), depth - 1)
    elif isinstance(value, list):
        names = [v.get("name") if isinstance(v, dict) else v for v in value]
        if 0 < len(names) <= _LONGEST and all(isinstance(n, str) for n in names):
            yield name, " + ".join(str(n) for n in names)
    elif not isinstance(value, dict) and value is not None:
        yield name, value
