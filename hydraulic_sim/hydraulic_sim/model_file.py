"""Model files: YAML with units, sources and a history; read with the place of every error, saved with comments kept.

format: hydraulic-model-1
name: my_bench
plant: hydraulic                      # or mechanical
parameters:
  piston_area_a: {value: 12.5 in^2, source: data sheet}
  moving_mass: 500 kg                 # the short form
effects:
  coulomb_friction: {level: {value: 450 N, fit: free, bounds: [0 N, 2000 N]}}
  spool_dynamics: {}                  # on, with the library's defaults
user_effects: [my_effect.py]          # relative to this file; Python, see `trust`
history: []
"""

from __future__ import annotations

import io
from importlib import resources
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.representer import RepresenterError

from hydraulic_interfaces.errors import one_line
from hydraulic_node_utils.whole_file import write_text
from hydraulic_node_utils.yaml_text import load_yaml

from .effect import Parameter, check_value
from .errors import EffectError, ModelError
from .model import KINDS, Entry, Model, check_bounds, check_within
from .model_document import FORMAT, document, plain
from .registry import check_file, library
from .trust import check_trusted
from .units import check_quantity, to_si

__all__ = ["Entry", "Model", "ModelError", "load_model", "presets", "save_model"]

TOP_KEYS = ("format", "name", "description", "plant", "parameters", "effects", "user_effects", "history")
ENTRY_KEYS = ("value", "source", "fit", "bounds", "standard_error", "printed", "note")


def presets() -> dict[str, Path]:
    """The models that ship with the package, by name."""
    folder = Path(str(resources.files("hydraulic_sim") / "presets"))
    return {file.stem: file for file in sorted(folder.glob("*.yaml"))}


def load_model(source: str | Path) -> Model:
    """Read a model file, or a preset by its name.

    :raises ModelError: it is not acceptable; the text names file, line, key, value and what is allowed.
    """
    path = Path(source)
    if not path.is_file():
        shipped = presets()
        if str(source) not in shipped:
            raise ModelError(f"{source}: no such model file; presets: {', '.join(shipped)}")
        path = shipped[str(source)]
    try:
        document = load_yaml(_yaml(), path.read_text(encoding="utf-8"))
    except MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        raise ModelError(f"{path}:{line}: not valid YAML: {error.problem}") from None
    except YAMLError as error:
        raise ModelError(f"{path}: not valid YAML: {one_line(error)}") from None
    except UnicodeDecodeError:
        raise ModelError(f"{path}: not a text file in UTF-8") from None
    return _Reader(path, document).model()


def save_model(model: Model, path: str | Path, overwrite: bool = False) -> Path:
    """Write a model; comments of the file it was read from are kept.

    The file appears whole or not at all.

    :raises ModelError: ``path`` exists, its folder does not, or the model does not compose or holds something that has
        no place in a file.
    """
    target = Path(path)
    if target.exists() and not overwrite:
        raise ModelError(f"{target} exists; give another name (nothing is overwritten silently)")
    if not target.parent.is_dir():
        raise ModelError(f"{target}: there is no folder {target.parent}")
    model.check_complete()
    try:
        write_text(target, model_text(model, target), overwrite=overwrite)
    except FileExistsError:
        raise ModelError(f"{target} exists; give another name (nothing is overwritten silently)") from None
    return target


def model_text(model: Model, target: Path) -> str:
    """The text of a model's file at ``target``, to whose folder paths in it are relative.

    :raises ModelError: the model holds something that has no place in a file.
    """
    stream = io.StringIO()
    try:
        _yaml().dump(document(model, target), stream)
    except RepresenterError as error:
        raise ModelError(f"{target}: {error}") from None
    return stream.getvalue()


def _yaml() -> YAML:
    yaml = YAML()
    yaml.width = 120
    yaml.preserve_quotes = True
    return yaml


class _Reader:
    """Turns a parsed document into a `Model`; every complaint names the line."""

    def __init__(self, path: Path, document: object) -> None:
        self.path = path
        if not isinstance(document, CommentedMap):
            raise ModelError(f"{path}: the file holds no mapping; expected the keys {', '.join(TOP_KEYS)}")
        self.document = document
        self.library = library()
        self.pending: frozenset[str] = frozenset()
        """Effects of files that have not been run yet."""

    def fail(self, node: object, key: object, what: str) -> ModelError:
        try:
            line = f":{node.lc.key(key)[0] + 1}"  # type: ignore[attr-defined]
        except Exception:
            line = ""
        return ModelError(f"{self.path}{line}: {what}")

    def model(self) -> Model:
        top = self.document
        self._only(top, TOP_KEYS, "the model")
        if top.get("format") != FORMAT:
            raise self.fail(top, "format", f"format is {top.get('format')!r}; expected {FORMAT!r}")
        kind = top.get("plant", "hydraulic")
        if kind not in KINDS:
            raise self.fail(top, "plant", f"plant is {kind!r}; allowed: {', '.join(KINDS)}")
        files = self._effect_files(top)
        if files:  # they are Python: nothing of them is run before everything else has been found in order
            self._read(top, kind, ())
            self.pending = frozenset()
            try:
                self.library = library(files)
            except EffectError as error:
                raise self.fail(top, "user_effects", str(error)) from None
        return self._read(top, kind, files)

    def _effect_files(self, top: CommentedMap) -> tuple[Path, ...]:
        """The effect files that the model names, all of which it may name."""
        taken: dict[str, Path] = {}
        for name in self._list(top, "user_effects"):
            if not isinstance(name, str) or not name.isprintable():
                raise self.fail(top, "user_effects", f"user_effects: expected names of files, found {name!r}")
            file = (self.path.parent / name).resolve()
            try:
                check_trusted(file, self.path)
                check_file(file)
            except EffectError as error:
                raise self.fail(top, "user_effects", str(error)) from None
            known = self.library.source_file(file.stem) if file.stem in self.library else taken.get(file.stem)
            if known:
                what = f"{file}: an effect named {file.stem!r} is already defined in {known}"
                raise self.fail(top, "user_effects", what)
            taken[file.stem] = file
        self.pending = frozenset(taken)
        return tuple(taken.values())

    def _read(self, top: CommentedMap, kind: str, files: tuple[Path, ...]) -> Model:
        """The model; of effects that are pending only the form is checked, and they are left out."""
        entries: dict[str, Entry] = {}
        self._section(self._mapping(top, "parameters"), "", entries)
        effects = []
        for name, values in self._mapping(top, "effects").items():
            section = top["effects"]
            if name not in self.library and name not in self.pending:
                known = ", ".join(sorted({*self.library, *self.pending}))
                raise self.fail(section, name, f"unknown effect {name!r}; the library has: {known}")
            if values is not None and not isinstance(values, CommentedMap):
                raise self.fail(section, name, f"effect {name}: expected a mapping of parameters, found {values!r}")
            if name in self.library and not self.library[name].always_on:
                effects.append(str(name))
            self._section(values or CommentedMap(), f"{name}.", entries)
        model = Model(
            name=str(top.get("name") or self.path.stem),
            description=str(top.get("description") or ""),
            kind=kind,
            entries=entries,
            effects=tuple(effects),
            user_effects=files,
            history=tuple(plain(h) for h in self._history()),
            path=self.path,
            document=top,
        )
        model.check_complete()
        return model

    def _list(self, node: CommentedMap, key: str) -> CommentedSeq:
        value = node.get(key)
        if value is None:
            return CommentedSeq()
        if not isinstance(value, CommentedSeq):
            raise self.fail(node, key, f"{key}: expected a list, found {value!r}")
        return value

    def _history(self) -> CommentedSeq:
        history = self._list(self.document, "history")
        for record in history:
            if not isinstance(record, CommentedMap):
                raise self.fail(self.document, "history", f"history: expected mappings, found {record!r}")
        return history

    def _mapping(self, node: CommentedMap, key: str) -> CommentedMap:
        value = node.get(key)
        if value is None:
            return CommentedMap()
        if not isinstance(value, CommentedMap):
            raise self.fail(node, key, f"{key}: expected a mapping, found {value!r}")
        return value

    def _only(self, node: CommentedMap, allowed: tuple[str, ...], where: str) -> None:
        for key in node:
            if key not in allowed:
                raise self.fail(node, key, f"{where} has no key {key!r}; allowed: {', '.join(allowed)}")

    def _section(self, node: CommentedMap, prefix: str, entries: dict[str, Entry]) -> None:
        for name, raw in node.items():
            key = f"{prefix}{name}"
            try:
                if prefix.rstrip(".") in self.pending:
                    self._form(key, raw)
                else:
                    entries[key] = self._entry(key, self.library.parameter(key), raw)
            except (EffectError, ModelError) as error:
                raise self.fail(node, name, str(error)) from None

    def _form(self, key: str, raw: object) -> None:
        """Check what can be said of an entry without knowing its parameter."""
        if not isinstance(raw, CommentedMap):
            check_quantity(raw, key)
            return
        self._fields(key, raw)
        check_quantity(raw["value"], key)
        for bound in raw.get("bounds") or ():
            check_quantity(bound, f"{key} bounds")
        if raw.get("standard_error") is not None:
            check_quantity(raw["standard_error"], f"{key} standard_error")

    def _fields(self, key: str, raw: CommentedMap) -> None:
        for inner in raw:
            if inner not in ENTRY_KEYS:
                raise ModelError(f"{key} has no field {inner!r}; allowed: {', '.join(ENTRY_KEYS)}")
        if "value" not in raw:
            raise ModelError(f"{key}: no value")
        fit, bounds = raw.get("fit"), raw.get("bounds")
        if fit not in (None, "free", "fixed"):
            raise ModelError(f"{key}: fit is {fit!r}; allowed: free, fixed")
        if bounds is not None and (not isinstance(bounds, CommentedSeq) or len(bounds) != 2):
            raise ModelError(f"{key}: bounds are {bounds!r}; expected [lowest, highest]")

    def _entry(self, key: str, record: Parameter, raw: object) -> Entry:
        if not isinstance(raw, CommentedMap):
            return Entry(check_value(record, to_si(raw, record.unit, key), key))  # type: ignore[arg-type]
        self._fields(key, raw)
        fit, bounds, error = raw.get("fit"), raw.get("bounds"), raw.get("standard_error")
        if bounds is not None:
            bounds = check_bounds(key, record, (to_si(b, record.unit, f"{key} bounds") for b in bounds))
        value = check_value(record, to_si(raw["value"], record.unit, key), key)
        check_within(key, record, value, bounds)
        return Entry(
            value=value,
            source=str(raw.get("source") or ""),
            free=None if fit is None else fit == "free",
            bounds=bounds,
            standard_error=None if error is None else to_si(error, record.unit, f"{key} standard_error"),
            printed=None if raw.get("printed") is None else str(raw["printed"]),
            note=None if raw.get("note") is None else str(raw["note"]),
        )
