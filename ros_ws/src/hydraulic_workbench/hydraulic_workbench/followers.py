"""Nodes beside the plant that a page starts and stops: the live model, the controller, the reference."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

from hydraulic_bringup.demo.processes import Child
from hydraulic_control.gains_file import shipped as shipped_gains
from hydraulic_control.laws import laws
from hydraulic_control.reference_parameters import PARAMETERS
from hydraulic_interfaces.contract import CONTROLLER_NODE, REFERENCE_NODE
from hydraulic_workbench.board import OFF, Board
from hydraulic_workbench.calls import Graph, NoAnswerError, NodeParameter, Said
from hydraulic_workbench.errors import NotNowError, WorkbenchError
from hydraulic_workbench.library import Entry
from hydraulic_workbench.processes import Processes
from hydraulic_workbench.reading.models import display

SAME_CHANGE_S = 1.0  # settings of one parameter that follow each other within this are one change


class Follower:
    """One node in a process of its own, under one key of the board."""

    def __init__(self, key: str, module: str, board: Board, processes: Processes) -> None:
        self._key, self._module, self._board, self._processes = key, module, board, processes
        self._child: Child | None = None

    @property
    def running(self) -> bool:
        """Whether its process runs."""
        return self._child is not None and self._child.exit_code is None

    async def start(self, parameters: dict[str, object], **shown: Any) -> None:
        """Start it in the place of the one that runs."""
        await self.stop()
        settings = [part for name, value in parameters.items() for part in ("-p", f"{name}:={value}")]
        self._child = self._processes.start(self._key, self._module, "--ros-args", *settings)
        self._board.change(self._key, phase="starting", text="starting …", **shown)

    async def stop(self) -> None:
        """End it."""
        child, self._child = self._child, None
        await self._processes.stop(child)
        self._board.put(self._key, {**dict.fromkeys(self._board[self._key]), **OFF})

    def watch(self, alive: bool) -> None:
        """Put on the board how it is; ``alive``: it has been heard of."""
        if self._child is None:
            return
        if self._child.exit_code is not None:
            bad = self._child.exit_code != 0
            text = f"it {self._child.ending().removeprefix('it ')}\n{self._child.tail()}" if bad else ""
            self._board.change(self._key, phase="failed" if bad else "off", text=text)
            self._child = None
        elif alive:
            self._board.change(self._key, phase="running", text="")


class LiveModel:
    """The model beside the plant: the estimator, with the model that a page chooses."""

    def __init__(self, board: Board, processes: Processes) -> None:
        self._board = board
        self.node = Follower("live_model", "hydraulic_sysid.nodes.estimator", board, processes)

    async def choose(self, model: Entry | None) -> None:
        """Run another model beside the plant, or none."""
        if model is None:
            await self.node.stop()
        else:
            await self.node.start({"model": str(model.file)}, model=model.id, name=model.document()["name"])

    def says(self, residual: float | None) -> None:
        """Put on the board what the node says of its residual: RMS of the position [m]."""
        self._board.change("live_model", residual=residual if self.node.running else None)


class Controller:
    """The controller and its gains, applied as they are set and undone on a click."""

    def __init__(self, board: Board, graph: Graph, processes: Processes, lockstep: Callable[[], bool]) -> None:
        self._board, self._graph, self._lockstep = board, graph, lockstep
        self.node = Follower("controller", "hydraulic_control.nodes.controller", board, processes)
        self._past: list[dict[str, Any]] = []
        self._changed = ("", 0.0)

    async def start(self, gains: Any) -> None:
        """Start a law with a shipped set of gains.

        :raises WorkbenchError: there is no such set.
        """
        if gains not in shipped_gains():
            raise WorkbenchError(f"gains is {gains!r}; allowed are {', '.join(shipped_gains())}", "gains")
        self._past = []
        own = {"gains": gains, "controller": gains, "autostart": True}
        await self.node.start(own | (PATIENT if self._lockstep() else {}), law=gains, can_undo=False)

    async def gains(self) -> dict[str, Any]:
        """The law's parameters as they are.

        :raises NotNowError: no controller runs.
        """
        self._need()
        known = {p.name: p for p in await self._graph.parameters(CONTROLLER_NODE)}
        law = known["controller"].value
        own = dict.fromkeys([*laws()[law].tuned, *(p.name for p in laws()[law].parameters)]) if law in laws() else {}
        wanted = [known[name] for name in own if name in known and isinstance(known[name].value, float)]
        return {"law": law, "parameters": [document(parameter) for parameter in wanted]}

    async def set(self, values: Any) -> dict[str, Any]:
        """Set gains, all or none."""
        self._need()
        if not isinstance(values, dict) or not values:
            raise WorkbenchError(f"values is {values!r}; it must be {{parameter: value}}", "values")
        known = {p.name: p for p in await self._graph.parameters(CONTROLLER_NODE)}
        for name in values:
            if name not in known:
                raise WorkbenchError(f"the controller has no parameter {name!r}", "values")
        before = {name: known[name].value for name in values}
        typed = {name: _typed(known[name], value) for name, value in values.items()}
        said = await self._graph.set_parameters(CONTROLLER_NODE, typed)
        if said.ok:
            self._remember(before)
        return await self._answer(said)

    async def undo(self) -> dict[str, Any]:
        """Take the last change back."""
        self._need()
        if not self._past:
            raise NotNowError("nothing has been changed since the controller was started")
        said = await self._graph.set_parameters(CONTROLLER_NODE, self._past[-1])
        if said.ok:
            self._past.pop()
            self._changed = ("", 0.0)
        return await self._answer(said)

    async def _answer(self, said: Said) -> dict[str, Any]:
        self._board.change("controller", can_undo=bool(self._past))
        return {"ok": said.ok, "message": said.message, **await self.gains()}

    def _remember(self, before: dict[str, Any]) -> None:
        names, now = ",".join(sorted(before)), time.monotonic()
        if self._changed[0] != names or now - self._changed[1] > SAME_CHANGE_S:
            self._past.append(before)
        self._changed = (names, now)

    def _need(self) -> None:
        if not self.node.running:
            raise NotNowError("no controller runs")


PATIENT: dict[str, object] = {"lockstep": True, "use_sim_time": True, "age_limit": 0.5}
"""Of a controller whose plant waits for it."""


WHOLE = frozenset(p.name for p in PARAMETERS if p.whole)
"""Parameters of the reference that are whole numbers."""


class Reference:
    """The reference that the controller follows."""

    def __init__(self, board: Board, graph: Graph, processes: Processes, lockstep: Callable[[], bool]) -> None:
        self._graph, self._lockstep = graph, lockstep
        self.node = Follower("reference", "hydraulic_control.nodes.reference", board, processes)

    async def start(self, kind: Any, values: Any) -> None:
        """Play a trajectory."""
        given = values if isinstance(values, dict) else {}
        if not isinstance(kind, str) or not kind.isidentifier():
            raise WorkbenchError(f"kind is {kind!r}; it must be the name of a trajectory", "kind")
        if not all(str(k).isidentifier() and isinstance(v, int | float) for k, v in given.items()):
            raise WorkbenchError(f"values is {values!r}; it must be {{parameter: number}}", "values")
        numbers = {k: round(v) if k in WHOLE else float(v) for k, v in given.items()}
        patient = {"use_sim_time": True, "state_timeout": 10.0} if self._lockstep() else {}
        await self.node.start(
            {"kind": kind, "autostart": True, "exit_when_done": True, **numbers, **patient}, kind=kind
        )

    async def stop(self) -> None:
        """Stop it: the controller then holds where the piston is."""
        if self.node.running:
            for _ in range(2):  # the second ends the holding
                try:
                    await self._graph.trigger(f"{REFERENCE_NODE}/stop", 1.0)
                except NoAnswerError:
                    break
                await asyncio.sleep(0.05)
        await self.node.stop()


def document(parameter: NodeParameter) -> dict[str, Any]:
    """A parameter for the page."""
    same = ("name", "value", "unit", "minimum", "maximum", "description", "live")
    return {key: getattr(parameter, key) for key in same} | {"display": display(parameter.unit), "choices": None}


def _typed(parameter: NodeParameter, value: Any) -> Any:
    """A value in the type that the parameter has.

    :raises WorkbenchError: it has another one, or lies out of the range.
    """
    kind = type(parameter.value)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        raise WorkbenchError(f"{parameter.name} is {value!r}; it must be of type {kind.__name__}", parameter.name)
    return value
