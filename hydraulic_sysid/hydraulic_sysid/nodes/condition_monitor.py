"""Node `/actuator/condition_monitor`: wear of the actuator over the bags of a folder, on `/diagnostics`.

Looks for complete bags, fits the new ones beside the bench (one process, one thread, low priority) and tells of each
followed parameter whether it has changed, since when, and when it reaches its limit. The page of the verb `monitor`
lies in ``output``. ``~/check`` looks at once.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from hydraulic_interfaces.contract import CONDITION_MONITOR_NODE, NAMESPACE
from hydraulic_interfaces.qos import profile
from hydraulic_node_utils.nodes import diagnostics
from hydraulic_node_utils.nodes.callbacks import trigger
from hydraulic_node_utils.nodes.parameters import ParameterTable
from hydraulic_node_utils.nodes.serving import ServedNode, serve
from hydraulic_node_utils.parameter_spec import ParameterSpec
from hydraulic_sim.model_file import load_model
from hydraulic_sysid.monitoring.follow import Follower, Row, rows

PARAMETERS = (
    ParameterSpec("model", "moog_mcr_m_1002_bench", "model file or preset that is fitted to each bag"),
    ParameterSpec("bags", "bags/*", "pattern of the bags, in the order of their names"),
    ParameterSpec("output", "monitored", "folder of the results and the page"),
    ParameterSpec("watch", "", "effects or parameters to follow; empty: the effects that grow with wear"),
    ParameterSpec("limits", "", "limits to forecast to, KEY=VALUE with units, separated by ';'"),
    ParameterSpec("bags_per_false_alarm", 200.0, "bags without a change until a false alarm", "", 2.0, 1e6),
    ParameterSpec("baseline", 5, "first bags, without alarm", "", 3, 1000),
    ParameterSpec("niceness", 10, "of the process that fits; 19 gives way to all others", "", 0, 19),
    ParameterSpec("period", 10.0, "it looks for new bags this often", "s", 0.1, 86400.0, live=True),
)
HEALTH_S = 1.0


class ConditionMonitor(ServedNode):
    """Parameters, the row on `/diagnostics`, and a `Follower`."""

    def __init__(self, **options: Any) -> None:
        """:raises HydraulicError: a model that cannot be used, or no pattern."""
        super().__init__(CONDITION_MONITOR_NODE, namespace=NAMESPACE, **options)
        self._table = ParameterTable(self, PARAMETERS, lambda name, value: None, locked=lambda: True)
        values = self._table.values()
        load_model(values["model"])  # a wrong one is told now, and not with the first bag
        self._follower = Follower(
            values["bags"], Path(values["output"]).expanduser(), _options(values), values["niceness"]
        )
        self._rows: list[Row] = []
        self._due = 0.0
        self._health = self.create_publisher(DiagnosticArray, "/diagnostics", profile("diagnostics"))
        self.create_timer(HEALTH_S, self._tell)
        trigger(self, "~/check", self._check)

    def _check(self) -> str:
        self._due = 0.0
        return "looks for new bags"

    def watch(self) -> None:
        """Look for new bags where it is time, and for what has been found."""
        now = time.monotonic()
        if not self._follower.busy and now < self._due:
            return
        found = self._follower.poll()
        if not self._follower.busy:
            self._due = now + self._table["period"]
        if found is not None:
            changed = {row.name for row in self._rows if row.changed}
            self._rows = rows(found)
            for row in self._rows[1:]:
                if row.changed and row.name not in changed:
                    self.get_logger().warning(f"{row.name}: {row.text}")
            self._tell()

    def _tell(self) -> None:
        me, problem = self.get_fully_qualified_name(), self._follower.problem
        first = self._rows[0] if self._rows else Row("", "no bag has been fitted yet", False, {})
        level = diagnostics.ERROR if problem else diagnostics.WARN if first.changed else diagnostics.OK
        figures = {**first.figures, "seen": self._follower.bags, "fitting": self._follower.busy}
        told = [diagnostics.row(f"{me}: condition", level, problem or first.text, figures, "actuator")]
        for row in self._rows[1:]:
            level = diagnostics.WARN if row.changed else diagnostics.OK
            told.append(diagnostics.row(f"{me}: {row.name}", level, row.text, row.figures, "actuator"))
        self._health.publish(diagnostics.array(self.get_clock().now().nanoseconds, *told))

    def close(self) -> None:
        """End a fit that is under way."""
        self._follower.close()


def _options(values: dict[str, Any]) -> list[str]:
    """The verb's options of the node's parameters."""
    found = ["--model", values["model"], "--bags-per-false-alarm", repr(values["bags_per_false_alarm"])]
    found += ["--baseline", str(values["baseline"])]
    limits = [text.strip() for text in values["limits"].split(";") if text.strip()]
    for option, several in (("--watch", values["watch"].replace(",", " ").split()), ("--limit", limits)):
        found += [option, *several] if several else []
    return found


def main(argv: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; exit code 0, 2 for a bad parameter or model."""
    return serve(ConditionMonitor, "Follow the wear of an actuator over many bags.", PARAMETERS, argv)


if __name__ == "__main__":
    raise SystemExit(main())
