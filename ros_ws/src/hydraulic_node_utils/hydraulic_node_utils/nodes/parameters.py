"""ROS parameters from a table: declared with description, unit and range, checked whenever they are set."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from hydraulic_node_utils.nodes.rclpy_internals import given_at_start
from hydraulic_node_utils.parameter_spec import ParameterSpec

# Stands for "unbounded" in a descriptor, which knows no infinity.
_UNBOUNDED = 1e308
_UNBOUNDED_INTEGER = 2**63 - 1


class ParameterTable:
    """The declared parameters of a node.

    `apply(name, value)` is called when a live parameter is to be set. If it raises, nothing is set: the caller hears
    why, and what was applied of the same request is taken back. `locked()` says whether the others may not be set now.
    """

    def __init__(
        self,
        node: Node,
        specs: Iterable[ParameterSpec] = (),
        apply: Callable[[str, Any], None] | None = None,
        locked: Callable[[], bool] | None = None,
    ) -> None:
        self._node = node
        self._apply = apply
        self._locked = locked
        self._specs: dict[str, ParameterSpec] = {}
        self._declaring = False
        node.add_on_set_parameters_callback(self._check)
        self.declare(specs)

    def declare(self, specs: Iterable[ParameterSpec]) -> None:
        """Declare further parameters; a value given at the start of the node wins over the default.

        :raises rclpy.exceptions.InvalidParameterValueException: such a value has the wrong type or range.
        """
        self._declaring = True
        try:
            for spec in specs:
                self._specs[spec.name] = spec
                try:
                    self._node.declare_parameter(spec.name, spec.default, descriptor(spec))
                except Exception:
                    del self._specs[spec.name]
                    raise
        finally:
            self._declaring = False

    def undeclare(self, names: Iterable[str]) -> None:
        """Take parameters back."""
        for name in list(names):
            self._node.undeclare_parameter(name)
            del self._specs[name]

    def __getitem__(self, name: str) -> Any:
        """Value of a declared parameter, in the type of its default."""
        return self._specs[name].check(self._node.get_parameter(name).value)

    def values(self) -> dict[str, Any]:
        """Values of all declared parameters by name."""
        return {name: self[name] for name in self._specs}

    def warn_of_unknown(self) -> None:
        """Log a warning for each value given at the start of the node that no declared parameter has taken."""
        for name in given_at_start(self._node):
            if not self._node.has_parameter(name):
                self._node.get_logger().warning(f"no parameter has the name {name!r}: the value given is not used")

    def _check(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            spec = self._specs.get(parameter.name)
            if spec is None:
                continue
            try:
                spec.check(parameter.value)
            except ValueError as error:
                return SetParametersResult(successful=False, reason=str(error))
            if not (spec.live or self._declaring) and self._locked is not None and self._locked():
                reason = f"{spec.name} is read when the node is configured: clean up the node to set it"
                return SetParametersResult(successful=False, reason=reason)
        return self._take(parameters)

    def _take(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Apply live parameters that were found acceptable, all or none."""
        applied: list[tuple[str, Any]] = []
        for parameter in parameters:
            spec = self._specs.get(parameter.name)
            if spec is None or not spec.live or self._declaring or self._apply is None:
                continue
            before = self[spec.name]
            try:
                self._apply(spec.name, spec.check(parameter.value))
            except Exception as error:  # whatever a plant throws: the caller must have an answer
                reason = f"{spec.name}: {_text(error)}"
                return SetParametersResult(successful=False, reason=reason + self._take_back(applied, self._apply))
            applied.append((spec.name, before))
        return SetParametersResult(successful=True)

    def _take_back(self, applied: list[tuple[str, Any]], apply: Callable[[str, Any], None]) -> str:
        """Apply the values from before, last first; what to add to the reason if one is refused."""
        problems = ""
        for name, before in reversed(applied):
            try:
                apply(name, before)
            except Exception as error:
                problems += f"; {name} could not be set back to {before!r}: {_text(error)}"
        if problems:
            self._node.get_logger().error(f"parameters and plant differ{problems}")
        return problems


def _text(error: Exception) -> str:
    return str(error) or type(error).__name__


def descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """Descriptor of a parameter as `ros2 param describe` shows it."""
    text = f"{spec.description} [{spec.unit}]" if spec.unit else spec.description
    # A number typed without a decimal point is an integer to ROS; the table's own check takes it for a float.
    result = ParameterDescriptor(description=text, dynamic_typing=isinstance(spec.default, float))
    result.additional_constraints = "" if spec.live else "read when the node is configured"
    if spec.minimum is None and spec.maximum is None:
        return result
    if isinstance(spec.default, float):
        low = -_UNBOUNDED if spec.minimum is None else float(spec.minimum)
        high = _UNBOUNDED if spec.maximum is None else float(spec.maximum)
        result.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    else:
        low = -_UNBOUNDED_INTEGER if spec.minimum is None else int(spec.minimum)
        high = _UNBOUNDED_INTEGER if spec.maximum is None else int(spec.maximum)
        result.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return result
