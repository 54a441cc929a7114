"""What the server asks of the graph, as plain values: how the pure part sees the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from hydraulic_interfaces.errors import HydraulicError


class NoAnswerError(HydraulicError):
    """A node that does not answer: it is not there, or hangs."""

    exit_code = 1


@dataclass(frozen=True)
class Said:
    """What a service answered: whether it did what was asked, and its words."""

    ok: bool
    message: str


@dataclass(frozen=True)
class NodeParameter:
    """One parameter of a node: value, unit, range (None: open), description, and whether it can be set now."""

    name: str
    value: Any
    unit: str
    minimum: float | None
    maximum: float | None
    description: str
    live: bool


class Graph(Protocol):
    """The part of the graph that the server sees. All calls may raise `NoAnswerError`.

    Names count from the namespace unless they begin with "/". Calls are repeated where no answer comes.
    """

    namespace: str

    async def trigger(self, name: str, patience: float = 5.0) -> Said:
        """Call a service without arguments."""

    async def switch(self, name: str, on: bool, patience: float = 5.0) -> Said:
        """Call a service that turns something on or off."""

    async def change_state(self, node: str, transition: str, patience: float) -> bool:
        """Take a managed node through a transition ("configure", "activate" …); whether it did it."""

    async def parameters(self, node: str) -> list[NodeParameter]:
        """All parameters of a node."""

    async def set_parameters(self, node: str, values: dict[str, Any], patience: float = 5.0) -> Said:
        """Set parameters of a node, all or none."""
