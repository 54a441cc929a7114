"""The plant that runs: started, watched, enabled, stopped; the page is told what each button will do."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

from hydraulic_bringup.demo.processes import Child
from hydraulic_bringup.verbs.virtual_bench import READY
from hydraulic_can_driver.bus_file import load_bus
from hydraulic_interfaces.contract import PLANT_NODE, absolute
from hydraulic_interfaces.errors import HydraulicError
from hydraulic_workbench.board import Board
from hydraulic_workbench.calls import Graph, NoAnswerError, Said
from hydraulic_workbench.diagnostics import HealthBoard
from hydraulic_workbench.errors import NotNowError, WorkbenchError
from hydraulic_workbench.plant_kinds import ATTACHED, CAN_VIRTUAL, DEVICES, GUESS, MODULES, Chosen, faults_of
from hydraulic_workbench.processes import Processes

START_S = 300.0  # the first start on a machine compiles the physics
ENABLE_S = 15.0  # a busy machine loses an answer, or takes seconds to find who asked
NOTHING = Chosen("none", "", lockstep=False)


def plain_words(tail: str) -> str:
    """The last lines of a node's log, each once, without the marks of the log: margin, level, time and node."""
    mark = re.compile(r"^ *\| (?:\[[A-Z]+\] \[[\d.]+\] \[[\w./]+\]: )?")
    return "\n".join(dict.fromkeys(mark.sub("", line) for line in tail.splitlines()))


class Plant:
    """One plant at a time. ``left`` is called before one ends: what commands it ends first.

    ``health`` is what is heard of it; what one plant said is forgotten once it has ended.
    """

    def __init__(
        self, board: Board, graph: Graph, processes: Processes, health: HealthBoard, left: Callable[[], Awaitable[None]]
    ) -> None:
        self._board, self._graph, self._processes, self._health, self._left = board, graph, processes, health, left
        self.chosen = NOTHING
        self._child: Child | None = None
        self._devices: Child | None = None
        self._starting: asyncio.Task[None] | None = None
        self._enabling: asyncio.Future[Said] | None = None
        self._faults: list[dict[str, Any]] = []
        self._phase, self._text = "stopped", "no plant runs"
        self._lock = asyncio.Lock()

    @property
    def running(self) -> bool:
        """Whether it is active."""
        return self._phase == "running"

    def attach(self) -> None:
        """Take the plant that somebody else runs in this graph."""
        self.chosen = Chosen(ATTACHED, "attached plant", lockstep=False)
        self._say("running", "a plant that somebody else has started")

    def begin(self, chosen: Chosen) -> None:
        """Start a plant in the place of the one that runs; the board says how it goes.

        :raises NotNowError: this workbench is attached to another one's plant.
        """
        if self.chosen.kind == ATTACHED:
            raise NotNowError("this workbench is attached to a plant that somebody else has started")
        if self._starting is not None:
            self._starting.cancel()
        self._starting = asyncio.create_task(self._start(chosen))

    async def _start(self, chosen: Chosen) -> None:
        async with self._lock:
            try:
                await self._end()
                self.chosen = chosen
                self._say("starting", f"starting {chosen.name}; the first start on a machine compiles the physics")
                await self._launch(chosen)
                self._say("running", f"{chosen.name} runs, at 0 V until it is enabled")
            except asyncio.CancelledError:
                await self._end()
                raise
            except HydraulicError as error:
                await self._end()
                self._say("failed", str(error))

    async def _launch(self, chosen: Chosen) -> None:
        if chosen.kind == CAN_VIRTUAL:
            self._devices = self._processes.start("devices", DEVICES, *chosen.device_options(), listens=True)
            await self._wait_for_devices(self._devices)
            self._faults = faults_of(load_bus(chosen.bus))
        settings = [part for name, value in chosen.parameters().items() for part in ("-p", f"{name}:={value}")]
        self._child = self._processes.start("plant", MODULES[chosen.kind], "--ros-args", *settings)
        if chosen.hidden:  # told by a call, since a command line is for all to read
            said = await self._asked_while_alive(
                self._graph.set_parameters(PLANT_NODE, {"extra_effects": chosen.hidden_text()}, START_S)
            )
            if not said.ok:
                raise WorkbenchError(f"the simulator refuses the hidden effects: {said.message}", "hidden")
        for transition in ("configure", "activate"):
            if not await self._asked_while_alive(self._graph.change_state(PLANT_NODE, transition, START_S)):
                raise WorkbenchError(f"the plant did not {transition}:\n{plain_words(self._child.tail())}")

    async def _wait_for_devices(self, child: Child) -> None:
        deadline = time.monotonic() + START_S
        while READY not in child.log.read_text(errors="replace"):
            if child.exit_code is not None or time.monotonic() > deadline:
                raise WorkbenchError(f"the virtual devices did not start:\n{child.tail()}")
            await asyncio.sleep(0.05)

    async def _asked_while_alive(self, call: Awaitable[Any]) -> Any:
        """The answer to a call, unless the plant's process ends meanwhile."""
        assert self._child is not None
        asked = asyncio.ensure_future(call)
        try:
            while not asked.done():
                await asyncio.wait({asked}, timeout=0.1)
                if self._child.exit_code is not None:
                    said = plain_words(self._child.tail())
                    raise WorkbenchError(f"the plant ended while it was started:\n{said}")
            return asked.result()
        finally:
            asked.cancel()

    async def stop(self) -> None:
        """End the plant; what commands it ends first."""
        if self.chosen.kind == ATTACHED:
            raise NotNowError("somebody else has started this plant; the workbench does not end it")
        if self._starting is not None:
            self._starting.cancel()
            with suppress(asyncio.CancelledError):
                await self._starting
        async with self._lock:
            await self._end()
        self.chosen = NOTHING
        self._say("stopped", "no plant runs")

    async def _end(self) -> None:
        self._take_back()
        await self._left()
        plant, devices = self._child, self._devices
        self._child = self._devices = None
        self._faults = []
        await self._processes.stop(plant)
        await self._processes.stop(devices)
        self._health.rows.clear()

    async def enable(self, on: bool) -> Said:
        """Let commands through, or no longer. What is asked later takes the place of what still waits for an answer.

        :raises NoAnswerError: the plant does not answer; what was asked to enable was then asked not to.
        """
        self._take_back()
        asked = self._enabling = asyncio.ensure_future(self._graph.switch("enable", on, ENABLE_S))
        try:
            return await asked
        except asyncio.CancelledError:
            if self._enabling is asked:
                raise
            return Said(False, "taken back before the plant had answered")
        except NoAnswerError:
            if on:
                with suppress(NoAnswerError):
                    await self._graph.switch("enable", False, 1.0)
            raise

    def _take_back(self) -> None:
        """No longer repeat a request to enable that waits for an answer."""
        waiting, self._enabling = self._enabling, None
        if waiting is not None:
            waiting.cancel()

    async def reset(self) -> Said:
        """Release a latched stop."""
        return await self._graph.trigger("reset")

    async def emergency_stop(self) -> dict[str, Any]:
        """0 V at once, latched; how long the answer took."""
        begun = time.perf_counter()
        self._take_back()
        try:
            said = await self._graph.trigger("emergency_stop", 3.0)
        except NoAnswerError as error:
            said = Said(False, f"{error}; without commands the plant's watchdog holds 0 V")
        return {"ok": said.ok, "message": said.message, "milliseconds": round((time.perf_counter() - begun) * 1e3, 2)}

    def fault(self, name: Any, node: Any, on: bool) -> None:
        """Begin or end a fault of the virtual devices.

        :raises WorkbenchError: there is no such fault here.
        """
        row = next((r for r in self._faults if (r["name"], r["node"]) == (name, node)), None)
        if row is None or self._devices is None:
            raise WorkbenchError(f"this plant cannot be given the fault {name!r} at {node!r}", "fault")
        try:
            self._devices.say(f"{'+' if on else '-'}{name}:{node}")
        except OSError:
            raise NotNowError("the virtual devices have ended") from None
        self._faults = [{**r, "on": on} if r is row else r for r in self._faults]

    def watch(self) -> None:
        """Put on the board how the plant is now; to be called some times a second."""
        if self.running and self._child is not None and self._child.exit_code is not None:
            self._say("failed", f"the plant has ended by itself: {self._child.ending()}\n{self._child.tail()}")
        own = absolute(PLANT_NODE, self._graph.namespace)
        plant, command = self._health.values(f"{own}: plant"), self._health.values(f"{own}: command")
        row = self._health.rows.get(f"{own}: plant")
        enabled, stopped = plant.get("enabled") == "True", plant.get("emergency_stop") == "True"
        active = self.running and bool(plant)
        hidden = self.chosen.kind == GUESS
        self._board.put(
            "plant",
            {
                "kind": self.chosen.kind,
                "name": self.chosen.name,
                "model": self.chosen.model_id,
                "phase": self._phase,
                "text": row.message if row is not None and active else self._text,
                "lockstep": self.chosen.lockstep,
                "real": self.chosen.real,
                "enabled": active and enabled,
                "stopped": active and stopped,
                "stop_reason": plant.get("stop_reason", ""),
                "fault": plant.get("fault", ""),
                "source": command.get("source", ""),
                "effects": "" if hidden else plant.get("effects", ""),
                "faults": self._faults,
                "may_enable": active and not enabled and not stopped and not plant.get("fault"),
                "may_reset": active and (stopped or bool(plant.get("fault"))),
                "enable_does": self._enable_does(active, enabled, stopped, command.get("source", "")),
                "reset_does": "Releases the latched stop. The plant stays at 0 V until it is enabled.",
            },
        )

    def _enable_does(self, active: bool, enabled: bool, stopped: bool, source: str) -> str:
        if not active:
            return "There is no plant to enable."
        if stopped:
            return "The plant is stopped: reset it first."
        if enabled:
            return "Commands move the piston now. Disabling gives 0 V at once."
        what = "The real piston" if self.chosen.real else "The simulated piston"
        now = f"{source} commands it now and moves it at once" if source else "nothing commands it now: it stays at 0 V"
        return f"{what} will obey commands. As it is, {now}."

    def _say(self, phase: str, text: str) -> None:
        self._phase, self._text = phase, text
        self._board.change("plant", phase=phase, text=text, kind=self.chosen.kind, name=self.chosen.name)
