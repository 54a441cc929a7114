"""What can be set on a controller: the shared parameters and those of every law, in one table.

The ROS parameters of the node, the parameter files that `tune` writes and the records that the compiled step reads all
derive from the files of `laws/`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hydraulic_control.errors import ControlError
from hydraulic_control.law import choice
from hydraulic_control.law_parts import PARAMETERS
from hydraulic_control.laws import laws
from hydraulic_node_utils.parameter_spec import ParameterSpec

CONTROLLERS = tuple(laws())
LAW: tuple[ParameterSpec, ...] = (
    choice("controller", "npid", CONTROLLERS, f"law: {', '.join(CONTROLLERS)}"),
    *PARAMETERS,
    *(spec for law in laws().values() for spec in law.parameters),
)
SPECS = {spec.name: spec for spec in LAW}


def check(name: str, value: Any) -> Any:
    """`value` of the parameter of that name, in its type.

    :raises HydraulicError: unknown name, or a value that the parameter cannot have.
    """
    if name not in SPECS:
        raise ControlError(f"{name!r} is no parameter of the controller; there are {', '.join(SPECS)}")
    return SPECS[name].check(value)


def complete(values: Mapping[str, Any]) -> dict[str, Any]:
    """All parameters: `values` where given and found acceptable (`check`), else defaults."""
    return {spec.name: spec.default for spec in LAW} | {name: check(name, value) for name, value in values.items()}


def as_number(name: str, value: Any) -> float:
    """A parameter as the compiled step reads it: choices by their place in the list."""
    choices = SPECS[name].choices
    return float(choices.index(value)) if choices else float(value)
