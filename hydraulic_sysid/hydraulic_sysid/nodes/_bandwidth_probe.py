"""The bandwidth as an action of the excitation node: play a small probe, and say what it found.

`~/measure_bandwidth` starts it, `~/bandwidth` (JSON, latched) tells the end: `event` (finished or failed), `reason`,
and of a probe that was played to its end what `bandwidth.document` says, without its curves.
"""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from std_msgs.msg import String

from hydraulic_interfaces.errors import HydraulicError
from hydraulic_interfaces.qos import profile
from hydraulic_interfaces.samples import PlantSample
from hydraulic_node_utils.nodes.callbacks import trigger
from hydraulic_sysid.excitation import Plan, load_plan

_CURVES = ("frequency", "response", "closed_loop", "coherence", "schema", "software")
_MOST_MISSING = 0.01
FAILED = "failed"


class BandwidthProbe:
    """`start` begins a plan or refuses it by an error; `plan` tells which one."""

    def __init__(self, node: Node, plan: Callable[[], str], start: Callable[[Plan], None]) -> None:
        self._plan_source, self._start = plan, start
        self._plan: Plan | None = None
        self._rows: list[tuple[int, float, float]] = []
        self._result = node.create_publisher(String, "~/bandwidth", profile("latched"))
        trigger(node, "~/measure_bandwidth", self._measure)

    def take(self, plan: Plan, sample: PlantSample) -> None:
        """Keep a state of the run of `plan`, if that is the probe."""
        if plan is self._plan:
            self._rows.append((sample.stamp_ns, sample.drive, sample.position))

    def end(self, played: Plan, finished: bool, reason: str) -> None:
        """The run of `played` has ended; where that was the probe, publish what it found."""
        if self._plan is None or played is not self._plan:
            return
        plan, rows, self._plan, self._rows = self._plan, self._rows, None, []
        content = _found(plan, rows) if finished else {"event": FAILED, "reason": reason}
        self._result.publish(String(data=json.dumps(content, allow_nan=False, ensure_ascii=False)))

    def _measure(self) -> str:
        plan = load_plan(self._plan_source())
        self._start(plan)
        self._plan, self._rows = plan, []
        return f"probing for {plan.total_time:g} s; the result is on ~/bandwidth"


def _found(plan: Plan, rows: list[tuple[int, float, float]]) -> dict[str, object]:
    """What the samples (stamp [ns], drive [V], position [m]) of a whole probe tell."""
    # Only here: they take longer to load than the node has to start.
    from hydraulic_sysid.data.records import Record
    from hydraulic_sysid.data.results import plain
    from hydraulic_sysid.linear.bandwidth import document, from_record

    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    values = np.array([row[1:] for row in rows], dtype=float)
    time = (stamps - stamps[0]) * 1e-9
    even = np.arange(int(np.floor(time[-1] * plan.rate + 0.5)) + 1) / plan.rate
    missing = 1.0 - stamps.size / even.size
    if missing > _MOST_MISSING or not np.isfinite(values).all():
        return {"event": FAILED, "reason": f"{missing:.1%} of the states are missing (allowed: {_MOST_MISSING:.0%})"}
    channels = {name: np.interp(even, time, values[:, i]) for i, name in enumerate(("drive", "position"))}
    description = {"experiment": {"plan": plan.as_mapping()}}
    record = Record.sampled(plan.name, 1.0 / plan.rate, channels, description=description)
    try:
        bandwidth, coherence = from_record(record)
    except HydraulicError as error:
        return {"event": FAILED, "reason": str(error)}
    whole = document(bandwidth, {"kind": "record", "name": plan.name, "path": ""}, coherence)
    return {"event": "finished", "reason": "", **plain({k: v for k, v in whole.items() if k not in _CURVES})}
