"""When a recording ends by itself."""

from __future__ import annotations

from hydraulic_sysid.data.bag.experiment import ExperimentLog

# What was on its way when the experiment ended still belongs to it. A packet that was lost is sent again within
# 3 s (the middleware's heartbeat); the streams then lag behind by that much.
_AFTER_END_NS = 200_000_000
_PATIENCE_NS = 4_000_000_000


class StopRule:
    """Ends after `max_duration` [s, 0: never], or when the experiment that was heard to start has ended."""

    def __init__(self, max_duration: float, on_experiment_end: bool) -> None:
        self._max_ns = round(max_duration * 1e9)
        self._on_experiment_end = on_experiment_end
        self._started_ns = 0
        self._ended_ns = 0

    def reason(self, clock_ns: int, steady_ns: int, experiment: ExperimentLog, reached_ns: int | None = None) -> str:
        """Why to end now; empty if not.

        `clock_ns` is what `max_duration` is measured with: a clock that may be simulated, and is 0 until it is
        heard. `steady_ns` goes on whatever happens to it. `reached_ns` is the stamp up to which the plant's streams
        have come, None if there are none: an experiment is complete when they have reached its end.
        """
        self._started_ns = self._started_ns or clock_ns
        if self._max_ns and clock_ns - self._started_ns >= self._max_ns:
            return "max_duration"
        if not experiment.ended:
            self._ended_ns = 0  # none has, or another one has started since
        if self._on_experiment_end and experiment.ended:
            self._ended_ns = self._ended_ns or steady_ns
            waited = steady_ns - self._ended_ns
            complete = reached_ns is None or reached_ns >= experiment.end_ns
            if waited >= (_AFTER_END_NS if complete else _PATIENCE_NS):
                return f"experiment {experiment.outcome}"
        return ""
