"""Node `/actuator/estimator`: what the plant is, while it runs.

Two estimates beside the plant, on the drive that was applied: a recursive ARX model of its own, whose coefficients,
poles and one-step fit come out at the model's sampling time (`model_parameters`, `model_poles`, `model_fit`); and the
physical model of the model file (`predicted_state`, `residual`, stamps of the state). `~/reset_covariance` lets the
ARX model learn anew, `~/save` writes it to a file.
"""

from __future__ import annotations

import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState

from hydraulic_interfaces.contract import ESTIMATOR_NODE, NAMESPACE
from hydraulic_interfaces.conversions import StateEncoder, sample_from_messages
from hydraulic_interfaces.qos import STREAM_HISTORY, profile
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.nodes.callbacks import trigger, understood
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.serving import ServedNode, serve
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_node_utils.scheduling import release_realtime_for_all, request_realtime_for_all
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.linear.models import ArxOrder
from hydraulic_sysid.linear.online import LiveModel, RecentRms, RunningArx
from hydraulic_sysid.nodes import _estimator_messages as messages

PARAMETERS = (
    ParameterSpec("model", "moog_mcr_m_1002_bench", "model file or preset run beside the plant; empty: none"),
    ParameterSpec("horizon", 1.0, "it starts from the measurement this often; 0: once", "s", 0.0, 3600.0, live=True),
    ParameterSpec("na", 3, "past outputs of the ARX model", "", 1, 10),
    ParameterSpec("nb", 3, "past inputs", "", 1, 10),
    ParameterSpec("nk", 1, "dead time in samples", "", 1, 50),
    ParameterSpec("sampling_time", 0.05, "of the ARX model", "s", 0.001, 10.0),
    ParameterSpec("forgetting", 0.998, "weight of a sample falls by this per sample", "", 0.5, 1.0, live=True),
    ParameterSpec("reset_period", 0.0, "covariance reset this often; 0: only when asked for", "s", 0.0, 1e6, live=True),
    ParameterSpec("output", "position", "what is modelled: position, velocity or force"),
    ParameterSpec("save_to", "", "file that ~/save writes the ARX model to", live=True),
    ParameterSpec("realtime_priority", 3, "FIFO priority where permitted, 0: none", "", 0, 98),
)
HEALTH_S = 0.5
RESIDUAL_S = 2.0  # over which `/diagnostics` gives the residual of the position
SILENCE_S = 1.0
GAP_NS = 20_000_000


class Estimator(ServedNode):
    """Parameters, topics and services around a `RunningArx` and a `LiveModel`."""

    def __init__(self, **options: Any) -> None:
        """:raises ValueError: a model or an order that cannot be used."""
        super().__init__(ESTIMATOR_NODE, namespace=NAMESPACE, **options)
        self._table = ParameterTable(self, PARAMETERS, self._apply, locked=lambda: True)
        values = self._table.values()
        order = ArxOrder(values["na"], values["nb"], values["nk"])
        self._arx = RunningArx(order, values["sampling_time"], values["forgetting"], values["output"], GAP_NS)
        self._live: LiveModel | None = None
        if values["model"]:
            self._live = LiveModel(load_model(values["model"]), values["horizon"], GAP_NS * 1e-9)
        # The model's two streams go out at the rate of the state, as bytes that were serialised once.
        self._streams = [
            (self.create_publisher(JointState, name, profile(name, STREAM_HISTORY)), StateEncoder())
            for name in ("predicted_state", "residual")
        ]
        self._told = {
            name: self.create_publisher(JointState, name, profile(name))
            for name in ("model_parameters", "model_poles", "model_fit")
        }
        self._health = self.create_publisher(DiagnosticArray, "/diagnostics", profile("diagnostics"))
        self.create_subscription(JointState, "state", self._on_state, profile("state", STREAM_HISTORY))
        self.create_timer(HEALTH_S, self._tell_health)
        trigger(self, "~/reset_covariance", self._reset)
        trigger(self, "~/save", lambda: f"wrote {self._arx.save(self._table['save_to'])}")
        self._heard = self._reset_at = time.monotonic()
        self._reset_period = values["reset_period"]
        self._count = self._bad = 0
        self._residual = RecentRms(round(RESIDUAL_S / HEALTH_S))
        if values["realtime_priority"]:  # what cannot keep up makes the plant send everything twice
            request_realtime_for_all(values["realtime_priority"])

    def destroy_node(self) -> None:
        """Give back what goes before ordinary processes, too: the process may go on."""
        release_realtime_for_all()
        super().destroy_node()

    def _apply(self, name: str, value: Any) -> None:
        if name == "forgetting":
            self._arx.set_forgetting(value)
        elif name == "reset_period":
            self._reset_period = value
        elif name == "horizon" and self._live is not None:
            self._live.horizon = value

    def watch(self) -> None:
        """What must happen without a message: the reset that is due."""
        if self._reset_period and time.monotonic() - self._reset_at >= self._reset_period:
            self._reset()

    def _on_state(self, message: JointState) -> None:
        sample = understood(self, "state", sample_from_messages, message)
        if sample is None:
            self._bad += 1
        else:
            self._take(sample)

    def _take(self, sample: PlantSample) -> None:
        self._heard, self._count = time.monotonic(), self._count + 1
        pair = self._live.take(sample) if self._live is not None else None
        for (publisher, encode), values in zip(self._streams, pair or (), strict=False):
            publisher.publish(encode(values))
        if pair is not None:
            self._residual.take(pair[1].position)
        output = getattr(sample, self._arx.output)
        if not math.isfinite(output):
            return
        for stamp_ns, step in self._arx.take(sample.stamp_ns, sample.drive, output):
            self._told["model_parameters"].publish(messages.parameters(self._arx.estimate, stamp_ns))
            self._told["model_poles"].publish(messages.poles(self._arx.estimate, stamp_ns))
            self._told["model_fit"].publish(messages.fit(step, self._arx.fit, stamp_ns))

    def _tell_health(self) -> None:
        silent = time.monotonic() - self._heard > SILENCE_S
        arx = self._arx.estimate
        text = "no state of the plant" if silent else f"{arx.order.text} after {arx.updates} samples"
        figures: dict[str, object] = {"states": self._count, "not_a_state": self._bad, "updates": arx.updates}
        figures |= {"one_step_fit_percent": f"{self._arx.fit.best_fit:.2f}", "certainty": f"{arx.certainty:.3g}"}
        if self._live is not None:
            figures |= {"model": self._live.plant.model.name, "restarts": self._live.restarts}
            figures["position_residual_rms_m"] = f"{self._residual.next():.4g}"
        now_ns = self.get_clock().now().nanoseconds
        self._health.publish(messages.health(self.get_fully_qualified_name(), text, silent, figures, now_ns))

    def _reset(self) -> str:
        self._arx.estimate.reset_covariance()
        self._reset_at = time.monotonic()
        return f"{self._arx.estimate.order.text} learns anew"


def main(argv: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; exit code 0, 2 for a bad parameter or model."""
    return serve(Estimator, "Estimate a model of the actuator while it runs.", PARAMETERS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
