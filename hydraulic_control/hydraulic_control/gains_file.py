"""Parameter files of the controller: what `tune` writes and the node reads, in the form of ROS parameter files.

# where the gains come from, as comments
/**/controller:
  ros__parameters:
    controller: npid
    kp: 150.0
"""

from __future__ import annotations

from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from hydraulic_control.errors import ControlError
from hydraulic_control.parameters import SPECS, check
from hydraulic_interfaces.contract import CONTROLLER_NODE
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_node_utils.yaml_text import load_yaml

FOLDER = Path(__file__).parent / "gains"
NODE = f"/**/{CONTROLLER_NODE}"
"""The controller in whatever namespace; a file may also name one, such as "/left/controller"."""


def shipped() -> tuple[str, ...]:
    """Names of the parameter files that come with the package."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def find(name_or_path: str | Path) -> Path:
    """The file of that path, or the shipped one of that name.

    :raises ControlError: there is none.
    """
    for path in (Path(name_or_path), FOLDER / f"{name_or_path}.yaml"):
        if path.is_file():
            return path
    raise ControlError(f"{name_or_path}: no such parameter file; shipped are {', '.join(shipped())}, or give a path")


def load(name_or_path: str | Path) -> dict[str, Any]:
    """Parameters of the controller in a file, checked; not all need to be there.

    :raises ControlError: a file that is no such file, or values that are not allowed.
    """
    path = find(name_or_path)
    try:
        document = load_yaml(YAML(typ="safe"), path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise ControlError(f"{path}: cannot be read: {error}") from None
    sections = document.items() if isinstance(document, dict) else ()
    found = [section for name, section in sections if str(name).endswith(f"/{CONTROLLER_NODE}")]
    rows = found[0].get("ros__parameters") if len(found) == 1 and isinstance(found[0], dict) else None
    if not isinstance(rows, dict):
        raise ControlError(f"{path}: expected one {NODE}, or {CONTROLLER_NODE} of a namespace, with ros__parameters")
    try:
        return {name: check(name, value) for name, value in _flat(rows).items() if name != "use_sim_time"}
    except HydraulicError as error:
        raise ControlError(f"{path}: {error}") from None


def text(values: Mapping[str, Any], remarks: str) -> str:
    """The file with those values, each with its unit and meaning, after the remarks."""
    rows = CommentedMap()
    for name, value in values.items():
        rows[name] = float(f"{value:.5g}") if isinstance(value, float) else value
        spec = SPECS[name]
        rows.yaml_add_eol_comment(f"{spec.unit}; {spec.description}" if spec.unit else spec.description, name)
    document = CommentedMap({NODE: CommentedMap({"ros__parameters": rows})})
    document.yaml_set_start_comment(remarks)
    stream = StringIO()
    writer = YAML()
    writer.width = 200
    writer.dump(document, stream)
    return stream.getvalue()


def _flat(rows: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in rows.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{before}{name}.")
        else:
            found[f"{before}{name}"] = value
    return found
