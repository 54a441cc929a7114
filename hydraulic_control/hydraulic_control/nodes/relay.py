"""Node `/actuator/relay`: the relay experiment through the topics, on a simulated or a real bench alike.

It commands the plant itself (no controller may be in command), one drive for every state, and ends at 0 V: after
cycles that agree, or beyond the limits of travel and time, or when the plant does not obey. The result goes into a JSON
file that `tune --relay` reads.
"""

from __future__ import annotations

import math
import time
from typing import Any

from sensor_msgs.msg import JointState

from hydraulic_control.errors import ControlError
from hydraulic_control.relay import SPECS, Relay, RelaySettings
from hydraulic_interfaces.contract import NAMESPACE, RELAY_NODE
from hydraulic_interfaces.conversions import CommandEncoder, sample_from_messages
from hydraulic_interfaces.qos import profile
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.json_file import NewJson
from hydraulic_node_utils.nodes.callbacks import understood
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.serving import ServedNode, serve
from hydraulic_node_utils.parameter_spec import ParameterSpec

PARAMETERS = (
    *SPECS,
    ParameterSpec("start_timeout", 30.0, "longest wait for a plant that obeys", "s", 0.1, 3600.0),
    ParameterSpec("state_timeout", 0.1, "silence of the state that breaks it off", "s", 0.01, 10.0),
    ParameterSpec("output", "", "new JSON file for the result; empty: it is only told"),
)
STATE_DEPTH = 10
_OBEYS_WITHIN_S = 0.05


class RelayNode(ServedNode):
    """Parameters and topics around a `Relay`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(RELAY_NODE, namespace=NAMESPACE, **options)
        values = ParameterTable(self, PARAMETERS, locked=lambda: True).values()
        self._relay = Relay(RelaySettings(**{spec.name: values[spec.name] for spec in SPECS}))
        self._output = NewJson(values["output"], ControlError)
        self._patience = time.monotonic() + values["start_timeout"]
        self._timeout = values["state_timeout"]
        self._encode = CommandEncoder(RELAY_NODE)
        self._command = self.create_publisher(JointState, "command", profile("command"))
        self._drive, self._heard = 0.0, time.monotonic()
        self._stamp_ns: int | None = None
        self._obeyed_ns: int | None = None
        self.create_subscription(JointState, "state", self._on_state, profile("state", STATE_DEPTH))

    def watch(self) -> None:
        """What must happen without a message: notice silence, give up waiting."""
        now = time.monotonic()
        if self._obeyed_ns is not None and now - self._heard > self._timeout:
            self._relay.abort(f"no state for {now - self._heard:.2f} s")
        elif self._obeyed_ns is None and now > self._patience:
            self._relay.abort("no plant obeyed: is it active and enabled, and nobody else in command?")
        if self._relay.done and not self.over:
            self._leave()

    def interrupt(self, name: str) -> None:
        """SIGINT or SIGTERM: 0 V, and leave."""
        self._relay.abort(f"interrupted by {name}")

    def close(self) -> None:
        """0 V at the end."""
        if self._stamp_ns is not None:
            self._command.publish(self._encode(self._stamp_ns + 1, 0.0))

    def _on_state(self, message: JointState) -> None:
        sample = understood(self, "state", sample_from_messages, message)
        if sample is None:
            return
        last, self._heard = self._stamp_ns, time.monotonic()
        if self._relay.done or (last is not None and sample.stamp_ns <= last):
            return
        self._stamp_ns = sample.stamp_ns
        dt = 0.0 if last is None else (sample.stamp_ns - last) * 1e-9
        self._drive = self._next(sample, dt)
        self._command.publish(self._encode(sample.stamp_ns, self._drive))

    def _next(self, sample: PlantSample, dt: float) -> float:
        """Until the plant applies a first drive, the relay's own waits."""
        amplitude = self._relay.settings.amplitude
        obeys = math.isfinite(sample.drive) and abs(abs(sample.drive) - amplitude) <= 0.3 * amplitude
        if obeys:
            first, self._obeyed_ns = self._obeyed_ns is None, sample.stamp_ns
            if first:
                self.get_logger().info("the plant obeys: relay experiment begins")
        if self._obeyed_ns is None:
            return amplitude
        if sample.stamp_ns - self._obeyed_ns > _OBEYS_WITHIN_S * 1e9:
            return self._relay.abort(f"the plant does not obey: it applies {sample.drive:g} V")
        return self._relay.step(dt, sample.position)

    def _leave(self) -> None:
        self.over = True
        result = self._relay.result
        if result is None:
            self.exit_code = 1
            self.get_logger().error(f"broken off: {self._relay.trouble}")
            return
        self.get_logger().info(f"critical gain {result.gain:.4g} V/m, critical period {1e3 * result.period:.4g} ms")
        settings = {"amplitude": self._relay.settings.amplitude, "hysteresis": self._relay.settings.hysteresis}
        try:
            self._output.write({**result.as_document(), **settings})
        except ControlError as error:
            self.exit_code = 1
            self.get_logger().error(str(error))


def main(argv: list[str] | None = None) -> int:
    """Run the experiment; exit code 0, 1 when it was broken off, 2 for a bad parameter."""
    return serve(RelayNode, "Measure the critical gain and period by a relay experiment.", PARAMETERS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
