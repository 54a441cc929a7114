"""A small node that drives the graph from outside: lifecycle, services, what recorder and excitation say."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from hydraulic_interfaces.contract import PLANT_NODE, RECORDER_NODE, absolute, service
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.json_file import json_object
from hydraulic_node_utils.nodes.exit_guard import exit_guard

_POLL_S = 0.1
# Fast DDS drops an answer where it has not found the asking client after 100 ms, which a busy machine exceeds.
_ASK_AGAIN_S = 5.0
_GOALS = {"configure": "inactive", "activate": "active", "deactivate": "inactive", "cleanup": "unconfigured"}

_LEFT: list[GraphClient] = []


def take_down_left(code: int) -> None:
    """The last thing of a program that used clients and ends with ``code``: take them out of the graph."""
    with exit_guard(code):
        while _LEFT:
            _LEFT.pop().take_down()


class GraphClient:
    """Context manager around a node with a thread of its own. It stays in the graph until `take_down_left`."""

    def __enter__(self) -> GraphClient:
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("bench_demo", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._status: dict[str, Any] = {}
        self._node.create_subscription(String, f"{absolute(RECORDER_NODE)}/status", self._on_status, profile("latched"))
        self._leaving = False
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving = True
        self._executor.wake()
        self._thread.join(2.0)
        _LEFT.append(self)

    def take_down(self) -> None:
        """Leave the graph; the middleware may never come back from this (see `exit_guard`)."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _spin(self) -> None:
        while not self._leaving:
            self._executor.spin_once(timeout_sec=0.1)

    def _on_status(self, message: String) -> None:
        status = json_object(message.data)
        if isinstance(status.get("output"), str):
            self._status[status["output"]] = status

    def recorder_status(self, folder: str) -> dict[str, Any]:
        """What the recorder has said last about a bag; empty before."""
        return dict(self._status.get(folder, {}))

    def change_state(self, label: str, patience: float, meanwhile: Callable[[], None] = lambda: None) -> bool:
        """Take the plant through a transition ("configure", "activate", …); whether it did it.

        ``meanwhile`` is called while there is no answer yet; what it raises ends the waiting.
        """
        request = ChangeState.Request()
        request.transition = Transition(id=getattr(Transition, f"TRANSITION_{label.upper()}"))
        plant, begun = absolute(PLANT_NODE), time.monotonic()
        answer = self._call(ChangeState, f"{plant}/change_state", request, patience, meanwhile)
        if answer is not None and not answer.success and time.monotonic() - begun > _ASK_AGAIN_S:
            # Where the first answer got lost, the second says that the transition is no longer possible.
            state = self._call(GetState, f"{plant}/get_state", GetState.Request(), patience, meanwhile)
            return state is not None and state.current_state.label == _GOALS[label]
        return answer is not None and bool(answer.success)

    def enable(self, patience: float) -> str:
        """Let commands through; empty, or why not."""
        return self._ask(SetBool, "enable", SetBool.Request(data=True), patience)

    def reset(self, patience: float) -> str:
        """Release a latched stop, if there is one; the plant then stays disabled. Empty, or why not."""
        return self._ask(Trigger, "reset", Trigger.Request(), patience)

    def _ask(self, kind: Any, name: str, request: Any, patience: float) -> str:
        answer = self._call(kind, service(name), request, patience)
        if answer is None:
            return f"no answer within {patience:g} s"
        return "" if answer.success else str(answer.message)

    def _call(
        self, kind: Any, name: str, request: Any, patience: float, meanwhile: Callable[[], None] = lambda: None
    ) -> Any:
        """The first answer; asked again where none comes, so the second question must do no harm."""
        client = self._node.create_client(kind, name)
        self._executor.wake()
        asked, deadline = 0.0, time.monotonic() + patience
        try:
            while not client.wait_for_service(timeout_sec=_POLL_S):
                meanwhile()
                if time.monotonic() > deadline:
                    return None
            futures: list[Any] = []
            while not any(future.done() for future in futures) and (now := time.monotonic()) < deadline:
                if not futures or now - asked > _ASK_AGAIN_S:
                    asked = now
                    futures.append(client.call_async(request))
                    self._executor.wake()
                meanwhile()
                time.sleep(0.01)
            return next((future.result() for future in futures if future.done()), None)
        finally:
            self._node.destroy_client(client)
