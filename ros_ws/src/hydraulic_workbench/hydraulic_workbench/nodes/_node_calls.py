"""Services of other nodes, with messages on one side and plain values on the other (see `calls.Graph`)."""

from __future__ import annotations

import asyncio
import time
from typing import Any

from lifecycle_msgs.msg import Transition
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future

from hydraulic_interfaces.contract import absolute
from hydraulic_interfaces.conversions import interface_class
from hydraulic_interfaces.errors import one_line
from hydraulic_workbench.calls import NoAnswerError, NodeParameter, Said
from hydraulic_workbench.nodes._graph_link import GraphLink

# Fast DDS drops an answer where it has not found the asking client after 100 ms, which a busy machine exceeds.
_ASK_AGAIN_S = 1.0
_POLL_S = 0.02
_UNBOUNDED = 1e300
_TRIGGER, _SET_BOOL = "std_srvs/srv/Trigger", "std_srvs/srv/SetBool"
_GOALS = {"configure": "inactive", "activate": "active", "deactivate": "inactive", "cleanup": "unconfigured"}


class NodeCalls:
    """Implements `calls.Graph` over a link; to be used in the thread of its loop."""

    def __init__(self, link: GraphLink) -> None:
        self._link, self.namespace = link, link.namespace
        self._clients: dict[tuple[str, str], Any] = {}
        for name in ("emergency_stop", "reset"):  # made ahead: a stop must find its service at once
            self._client(_TRIGGER, name)
        self._client(_SET_BOOL, "enable")

    async def trigger(self, name: str, patience: float = 5.0) -> Said:
        """See `calls.Graph`."""
        answer = await self._call(_TRIGGER, name, patience)
        return Said(bool(answer.success), str(answer.message))

    async def switch(self, name: str, on: bool, patience: float = 5.0) -> Said:
        """See `calls.Graph`."""
        answer = await self._call(_SET_BOOL, name, patience, data=on)
        return Said(bool(answer.success), str(answer.message))

    async def change_state(self, node: str, transition: str, patience: float) -> bool:
        """See `calls.Graph`. A first answer that got lost shows in the state that the node is in."""
        asked = Transition(id=getattr(Transition, f"TRANSITION_{transition.upper()}"))
        answer = await self._call("lifecycle_msgs/srv/ChangeState", f"{node}/change_state", patience, transition=asked)
        if answer.success:
            return True
        state = await self._call("lifecycle_msgs/srv/GetState", f"{node}/get_state", patience)
        return bool(state.current_state.label == _GOALS[transition])

    async def parameters(self, node: str) -> list[NodeParameter]:
        """See `calls.Graph`."""
        kind = "rcl_interfaces/srv/{}Parameters".format
        names = list((await self._call(kind("List"), f"{node}/list_parameters", 5.0)).result.names)
        values = (await self._call(kind("Get"), f"{node}/get_parameters", 5.0, names=names)).values
        described = (await self._call(kind("Describe"), f"{node}/describe_parameters", 5.0, names=names)).descriptors
        return [
            _parameter(name, parameter_value_to_python(value), descriptor)
            for name, value, descriptor in zip(names, values, described, strict=True)
        ]

    async def set_parameters(self, node: str, values: dict[str, Any], patience: float = 5.0) -> Said:
        """See `calls.Graph`."""
        rows = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        kind, name = "rcl_interfaces/srv/SetParametersAtomically", f"{node}/set_parameters_atomically"
        result = (await self._call(kind, name, patience, parameters=rows)).result
        return Said(bool(result.successful), str(result.reason))

    def _client(self, kind: str, name: str) -> Any:
        key = kind, absolute(name, self.namespace)
        if key not in self._clients:
            self._clients[key] = self._link.node.create_client(interface_class(kind), key[1])
            self._link.executor.wake()
        return self._clients[key]

    async def _call(self, kind: str, name: str, patience: float, **fields: Any) -> Any:
        client, full = self._client(kind, name), absolute(name, self.namespace)
        request = interface_class(kind).Request(**fields)
        deadline = time.monotonic() + patience
        while not client.service_is_ready():
            if time.monotonic() > deadline:
                raise NoAnswerError(f"nobody serves {full}")
            await asyncio.sleep(_POLL_S)
        loop = asyncio.get_running_loop()
        done: asyncio.Future[Any] = loop.create_future()
        while (left := deadline - time.monotonic()) > 0.0:
            future = client.call_async(request)
            self._link.executor.wake()
            future.add_done_callback(lambda f: _hand_over(loop, done, f))
            try:
                return await asyncio.wait_for(asyncio.shield(done), min(_ASK_AGAIN_S, left))
            except asyncio.TimeoutError:
                continue
        raise NoAnswerError(f"{full} did not answer within {patience:g} s")


def _hand_over(loop: asyncio.AbstractEventLoop, done: asyncio.Future[Any], future: Future) -> None:
    """The answer from the graph's thread to the loop's."""

    def give() -> None:
        if done.done():
            return
        if (error := future.exception()) is not None:
            done.set_exception(NoAnswerError(one_line(error)))
        else:
            done.set_result(future.result())

    if not loop.is_closed():
        loop.call_soon_threadsafe(give)


def _parameter(name: str, value: Any, descriptor: Any) -> NodeParameter:
    low = high = None
    for span in (*descriptor.floating_point_range, *descriptor.integer_range):
        low = span.from_value if abs(span.from_value) < _UNBOUNDED else None
        high = span.to_value if abs(span.to_value) < _UNBOUNDED else None
    text, _, unit = descriptor.description.partition(" [")
    live = not descriptor.read_only and "configured" not in descriptor.additional_constraints
    return NodeParameter(name, value, unit.rstrip("]"), low, high, text, live)
