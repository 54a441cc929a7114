"""What can be set on the controller node: the law's parameters, and when it does not answer."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter

from hydraulic_control import gains_file
from hydraulic_control.compiled_law import compiled, ready
from hydraulic_control.errors import ControlError
from hydraulic_control.law import Law
from hydraulic_control.laws import laws
from hydraulic_control.parameters import LAW, SPECS
from hydraulic_control.session import ControlSession
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.rclpy_internals import given_at_start
from hydraulic_node_utils.parameter_spec import ParameterSpec

SAFETY: tuple[ParameterSpec, ...] = (
    ParameterSpec("age_limit", 0.02, "age of a state, or silence, that gives 0 V", "s", 1e-3, 1.0, live=True),
    ParameterSpec("reference_age_limit", 0.5, "age from which a reference that comes is refused", "s", 0.01, 2.0),
    ParameterSpec("reference_timeout", 0.1, "age of a reference from which it stands", "s", 1e-3, 1e3, live=True),
    ParameterSpec("travel", 0.7, "largest reference to either side", "m", 0.0, 100.0, live=True),
    ParameterSpec("speed_limit", 20.0, "a position that leaps faster is not believed", "m/s", 0.1, 1e6, live=True),
    ParameterSpec("applied_tolerance", 0.05, "between the applied drive and the commands", "V", 1e-3, 1.0),
)
PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec("autostart", False, "configure and activate at start"),
    ParameterSpec("lockstep", False, "a state waits for the reference of its instant; for a plant in lockstep"),
    ParameterSpec("realtime_priority", 15, "FIFO priority while active where permitted, 0: none", "", 0, 98),
    ParameterSpec("gains", "", f"parameter file of the gains, or one of {', '.join(gains_file.shipped())}; ''"),
    *SAFETY,
    *LAW,
)


_OF_REFERENCES = {"reference_age_limit": "age_limit", "reference_timeout": "timeout", "travel": "travel"}


class ControllerParameters:
    """The node's parameters, applied to the session as they are set; `locked` as of `ParameterTable`.

    :param active: whether the loop runs, so that nothing may take seconds
    :raises ValueError: a value given at the start is not acceptable.
    """

    def __init__(
        self, node: Node, session: ControlSession, locked: Callable[[], bool], active: Callable[[], bool]
    ) -> None:
        self._node, self._session, self._loaded, self._active = node, session, "", active
        self._coming: tuple[str, threading.Thread] | None = None
        self.table = ParameterTable(node, PARAMETERS, self._apply, locked)
        for spec in SAFETY:
            self._apply(spec.name, self.table[spec.name])
        session.controller.set({spec.name: self.table[spec.name] for spec in LAW})

    def load_gains(self) -> None:
        """Take the gains of the file that is named, once, where the start of the node did not say otherwise.

        :raises ValueError: the file or a value in it is not acceptable.
        """
        gains = self.table["gains"]
        if not gains or gains == self._loaded:
            return
        given = given_at_start(self._node)
        values = {name: value for name, value in gains_file.load(gains).items() if name not in given}
        self._session.controller.set(values)  # all at once: one by one they need not go together
        for result in self._node.set_parameters([Parameter(name, value=value) for name, value in values.items()]):
            if not result.successful:
                raise ValueError(result.reason)
        self._loaded = gains

    def _apply(self, name: str, value: Any) -> None:
        if name == "controller" and self._active():
            self._begin_change(laws()[value])
        elif name in SPECS:
            self._session.controller.set({name: value})
        elif name in _OF_REFERENCES:
            setattr(self._session.references, _OF_REFERENCES[name], value)
        else:
            setattr(self._session, name, value)

    def _begin_change(self, law: Law) -> None:
        """Load a law beside the loop, which goes on meanwhile; `watch` adopts it."""
        if not ready(law):
            raise ControlError(f"controller {law.name!r} must be compiled first, for seconds: set it while not active")
        law.design(self._session.controller.values)  # may refuse
        self._coming = law.name, threading.Thread(target=compiled, args=(law,), daemon=True)
        self._coming[1].start()

    def watch(self) -> None:
        """Adopt the law that was asked for, once it is loaded."""
        if self._coming is not None and not self._coming[1].is_alive():
            name, self._coming = self._coming[0], None
            try:
                self._session.controller.set({"controller": name})
            except ControlError as error:  # what it is made from has been changed meanwhile
                self._node.get_logger().error(f"controller stays as it is: {error}")
