"""The text in which a running simulator is told of effects that its model file does not have."""

from __future__ import annotations

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from hydraulic_interfaces.errors import one_line
from hydraulic_node_utils.yaml_text import load_yaml
from hydraulic_plant_node.plant_backend import BackendError
from hydraulic_sim.model import Model


def switched(model: Model, extra: tuple[str, ...], text: str) -> tuple[Model, tuple[str, ...]]:
    """The model with exactly the effects of ``text`` beside its own, instead of ``extra``; and their names.

    :raises BackendError: a bad text, or one of the model's own effects.
    :raises ModelError: what does not compose.
    """
    wanted = extra_effects(text)
    for name in extra:
        model = model.without_effect(name)
    for name, values in wanted.items():
        if name in model.effects:
            raise BackendError(f"{name} is one of the model's own effects; set model.{name}.… instead")
        model = model.with_effect(name, values)
    return model, tuple(wanted)


def extra_effects(text: str) -> dict[str, dict[str, float]]:
    """Effect → its parameters [SI] in a YAML mapping; an effect without parameters (null) has the library's defaults.

    Whether effects and parameters exist is the model's business.

    :raises BackendError: what is no such mapping.
    """
    try:
        document = load_yaml(YAML(typ="safe"), text) if text.strip() else {}
    except YAMLError as error:
        raise BackendError(f"extra_effects is no YAML: {one_line(error)}") from None
    if isinstance(document, str):
        document = {document: None}
    if not isinstance(document, dict):
        raise BackendError(f"extra_effects is {text!r}; it must be a mapping, {{effect: {{parameter: value}}}}")
    found: dict[str, dict[str, float]] = {}
    for name, values in document.items():
        if not isinstance(values, dict | None):
            raise BackendError(f"extra_effects: {name} has {values!r}; it must have a mapping, {{parameter: value}}")
        found[str(name)] = {str(key): _number(name, key, value) for key, value in (values or {}).items()}
    return found


def _number(name: object, key: object, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise BackendError(f"extra_effects: {name}.{key} is {value!r}; it must be a number in SI units")
    return float(value)
