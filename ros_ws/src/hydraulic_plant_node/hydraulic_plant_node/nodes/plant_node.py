"""The managed node that serves the whole contract over a `PlantBackend`: simulated and real plants alike.

States: `configure` loads the plant, `activate` starts the loop at 0 V and *not enabled* (parameter
`enable_on_activate` changes that), the service `enable` lets commands through. `emergency_stop` works in
every state and survives all transitions until `reset`. A backend that fails leaves the node unconfigured, at
0 V. One that hangs does so too, but is not released, and not configured again, before its step has returned.
"""

from __future__ import annotations

import gc
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from hydraulic_interfaces.contract import NAMESPACE, PLANT_NODE, RATE_HZ, WATCHDOG_S
from hydraulic_interfaces.conversions import interface_class
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes.guarded_lifecycle import guard_transitions
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_plant_node.command_gate import CommandGate
from hydraulic_plant_node.nodes.plant_guard import PlantGuard
from hydraulic_plant_node.nodes.plant_health import PlantHealth
from hydraulic_plant_node.nodes.plant_ports import PlantPorts
from hydraulic_plant_node.plant_backend import PlantBackend
from hydraulic_plant_node.plant_loop import LoopTiming, PlantLoop
from hydraulic_plant_node.travel_limits import TravelLimits

SUCCESS, FAILURE, ERROR = (
    TransitionCallbackReturn.SUCCESS,
    TransitionCallbackReturn.FAILURE,
    TransitionCallbackReturn.ERROR,
)
_WATCH_PERIOD_S = 0.1
_REPORT_EVERY = 5
_HANGS = "the plant loop hangs in its backend"

PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec("rate", RATE_HZ, "sampling rate of the plant", "Hz", 1.0, 5000.0),
    ParameterSpec("watchdog", WATCHDOG_S, "silence of the source until 0 V; hardware: 0.2 at most", "s", 0.002, 10.0),
    ParameterSpec("enable_on_activate", False, "obey commands from activation on, without `enable`; not on hardware"),
    ParameterSpec("autostart", False, "configure and activate at start"),
    ParameterSpec("lockstep", False, "plant time waits for the answer to each state; publishes /clock"),
    ParameterSpec("realtime_priority", 20, "FIFO priority of the loop where permitted, 0: none", "", 0, 98),
)


def parameters_of(backend: PlantBackend) -> list[ParameterSpec]:
    """Parameters of the node; one that the backend has under the same name takes the place of the node's own."""
    return list({spec.name: spec for spec in (*PARAMETERS, *backend.parameters())}.values())


class PlantNode(LifecycleNode):
    """Topics, services, lifecycle and diagnostics of `backend` as the contract says."""

    def __init__(self, backend: PlantBackend, **kwargs: Any) -> None:
        super().__init__(PLANT_NODE, namespace=NAMESPACE, **kwargs)
        guard_transitions(self)
        self._backend = backend
        self._state = "unconfigured"
        self._error = ""
        self._loop: PlantLoop | None = None
        self._hung: PlantLoop | None = None
        self._last_stamp_ns = 0
        self._late_parameters: list[str] = []
        self.gate = CommandGate()
        self._table = ParameterTable(self, parameters_of(backend), self._apply, lambda: self._state != "unconfigured")
        self._ports = PlantPorts(self)
        self._guard = PlantGuard(self, self.gate, backend)
        self._followed = False
        self._health = PlantHealth(self.get_fully_qualified_name(), self.gate, backend)
        self._diagnostics = self.create_publisher(
            interface_class("diagnostic_msgs/msg/DiagnosticArray"), "/diagnostics", profile("diagnostics")
        )
        self.create_service(SetBool, "enable", self._on_enable)
        self.create_service(Trigger, "emergency_stop", self._on_emergency_stop)
        self.create_service(Trigger, "reset", self._on_reset)
        self._watched: tuple[object, ...] = ()
        self._watch_count = 0
        self.create_timer(_WATCH_PERIOD_S, self._watch)
        if self._table["autostart"]:
            self._starter = self.create_timer(0.0, self._autostart)

    @property
    def state(self) -> str:
        """Lifecycle state by its name."""
        return self._state

    def end_loop(self, patience: float) -> bool:
        """Latch 0 V and end the loop, from any thread, for a process that leaves; False if it hangs for `patience` [s].

        The orderly way is the lifecycle; this one is for when the thread that serves it does not return.
        """
        self.gate.stop("leaving")
        loop = self._loop or self._hung
        return loop is None or loop.stop(patience)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Read the parameters and load the plant; FAILURE with a log line if that cannot be done."""
        if self._hangs():
            self._complain(f"cannot configure: {_HANGS}; wait until it returns, or end this process")
            return FAILURE
        self._error = ""
        try:
            values = self._table.values()
            lockstep = values["lockstep"]
            own_clock = lockstep or values.get("publish_clock", False)
            if self.get_parameter("use_sim_time").value and not own_clock:
                raise ValueError("use_sim_time is true: a plant follows no other clock, it may only publish one")
            factor = values.get("real_time_factor", 1.0)
            LoopTiming(1, factor, own_clock, lockstep)  # refuses what contradicts itself before anything is loaded
            self._guard.enter(values, own_clock)
            self.gate.watchdog = values["watchdog"]
            late = self._backend.configure(values)
            period_ns = round(1e9 / self._backend.sampling_rate(values))
            priority = 0 if lockstep else values["realtime_priority"]  # nothing is gained by being in time
            self._timing = LoopTiming(period_ns, factor, own_clock, lockstep, priority)
            ends = self._backend.ends_of_travel()
            self.gate.limits = None if ends is None else TravelLimits(ends, 1e-9 * period_ns)
            self._late_parameters = [spec.name for spec in late]
            self._table.declare(late)
            for spec in late:
                if self._table[spec.name] != spec.default:
                    self._backend.set_parameter(spec.name, self._table[spec.name])
        except Exception as error:
            self._release(f"cannot configure: {error}")
            return FAILURE
        self._ports.open_state()
        self._guard.serve()
        if self._timing.own_clock:
            self._ports.open_clock()
            self.set_parameters([Parameter("use_sim_time", value=False)])
        if self._timing.lockstep:
            self._ports.follow_recorders()
        self._table.warn_of_unknown()
        self._ports.describe(self._backend.description())
        self._state = "inactive"
        return SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the plant loop at 0 V."""
        self._ports.discard_commands()
        # The loop collects before it starts, which takes long the first time: not while a plant waits to be stepped.
        gc.collect()
        gc.freeze()
        try:
            self._backend.activate()
            self._switch(self._table["enable_on_activate"])
        except Exception as error:
            gc.unfreeze()
            self._complain(f"cannot activate: {error}")
            self.gate.enable(False)
            self._withdraw()
            return FAILURE
        self._loop = PlantLoop(self._backend, self.gate, self._ports, self._timing, self._last_stamp_ns)
        self._loop.start()
        self._state = "active"
        return SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """0 V, then stop the loop; ERROR if it had failed."""
        return SUCCESS if self._halt() else ERROR

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the plant."""
        self._release("")
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """From whatever state: 0 V, loop stopped, plant released."""
        self._hangs()
        self._halt()
        if self._state == "inactive":
            self._release("")
        self._state = "finalized"
        return SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release the plant; the node can be configured again."""
        self._halt()
        self._release("")
        return SUCCESS

    def _halt(self) -> bool:
        """End the loop at 0 V; False if it had failed or hangs."""
        loop = self._loop
        if loop is None:
            return True
        try:
            self._switch(False)
        except Exception as error:
            self._complain(f"disabling failed: {error}")
        ended = loop.stop()
        self._loop = None
        if not ended:
            self._complain(_HANGS)
            self._hung = loop
            return False
        if loop.error is not None:
            self._complain(f"the plant loop ended: {type(loop.error).__name__}: {loop.error}")
        self._last_stamp_ns = loop.last_stamp_ns
        self._state = "inactive"
        return loop.error is None

    def _release(self, problem: str) -> None:
        if problem:
            self._complain(problem)
        self._table.undeclare(name for name in self._late_parameters if self.has_parameter(name))
        self._late_parameters = []
        if self._hung is None:  # else its thread is still at work in what would be released
            self._clean_up()
        self._state = "unconfigured"

    def _withdraw(self) -> None:
        try:
            self._backend.deactivate()
        except Exception as error:
            self._complain(f"deactivating failed: {error}")

    def _clean_up(self) -> None:
        try:
            self._backend.cleanup()
        except Exception as error:
            self._complain(f"cleanup failed: {error}")
        self._guard.leave()

    def _hangs(self) -> bool:
        """Whether a loop that hung still does; once it has ended, the plant is released."""
        loop = self._hung
        if loop is None or loop.alive:
            return loop is not None
        self._hung, self._last_stamp_ns = None, loop.last_stamp_ns
        self.get_logger().warning("the plant loop that hung in its backend has ended")
        self._clean_up()
        return False

    def _switch(self, on: bool) -> None:
        self._followed = self.gate.enable(on) and on
        self._backend.set_enabled(self._followed)

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        if request.data and self._state != "active":
            response.message = f"the plant is {self._state}, not active"
            return response
        if request.data and self.gate.stopped:
            response.message = f"stopped: {self.gate.stop_reason}; call reset first"
            return response
        try:
            self._switch(request.data)
            response.success, response.message = True, "enabled" if request.data else "disabled"
        except Exception as error:
            self.gate.enable(False)
            response.message = f"the plant refuses: {error}"
            self.get_logger().error(response.message)
        return response

    def _on_emergency_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.gate.stop("emergency stop")
        response.success, response.message = True, "stopped: 0 V until reset"
        self.get_logger().warning("emergency stop")
        self._disable()
        return response

    def _disable(self) -> None:
        """Let the backend follow a gate that holds 0 V already."""
        self._followed = False
        try:
            self._backend.set_enabled(False)
        except Exception as error:
            self.get_logger().error(f"disabling failed: {error}")

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            self._guard.check_alone()
            self._backend.reset()
        except Exception as error:
            response.message = f"the fault is still there: {error}"
            return response
        self.gate.reset()
        response.success, response.message = True, "released; call enable to let commands through"
        return response

    def _apply(self, name: str, value: Any) -> None:
        if self._state != "unconfigured":
            self._backend.set_parameter(name, value)

    def _autostart(self) -> None:
        self._starter.cancel()
        if self.trigger_configure() == SUCCESS:
            self.trigger_activate()

    def _watch(self) -> None:
        self._hangs()
        loop = self._loop
        if loop is not None and loop.error is not None:
            self.trigger_deactivate()
        self._guard.watch()
        if self._followed and self.gate.stopped and not self._backend.fault:  # a fault is the backend's own affair
            self.get_logger().error(f"stopped until reset: {self.gate.stop_reason}")
            self._disable()
        urgent = self._health.urgent()
        if urgent != self._watched or self._watch_count % _REPORT_EVERY == 0:
            self._watched = urgent
            now = self.get_clock().now().nanoseconds if self._loop is None else self._loop.now_ns()
            self._diagnostics.publish(
                self._health.message(self._state, self._loop, self._error, now, self._guard.not_heard)
            )
        self._watch_count += 1
        if self._loop is not None:
            # The collector is off while the loop runs; what a call or a report left behind is a handful of
            # objects.
            gc.collect()

    def _complain(self, problem: str) -> None:
        self._error = problem
        self.get_logger().error(problem)
