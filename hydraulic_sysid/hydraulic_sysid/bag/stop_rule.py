"""When a recording ends by itself."""

from __future__ import annotations

from hydraulic_sysid.bag.experiment import ExperimentLog

# What was on its way when the experiment ended still belongs to it.
_AFTER_END_NS = 200_000_000


class StopRule:
    """Ends after `max_duration` [s, 0: never], or when the experiment that was heard to start has ended."""

    def __init__(self, max_duration: float, on_experiment_end: bool) -> None:
        self._max_ns = round(max_duration * 1e9)
        self._on_experiment_end = on_experiment_end
        self._started_ns = 0
        self._ended_ns = 0

    def reason(self, clock_ns: int, steady_ns: int, experiment: ExperimentLog) -> str:
        """Why to end now; empty if not.

        `clock_ns` is what `max_duration` is measured with: a clock that may be simulated, and is 0 until it is
        heard. `steady_ns` goes on whatever happens to it.
        """
        self._started_ns = self._started_ns or clock_ns
        if self._max_ns and clock_ns - self._started_ns >= self._max_ns:
            return "max_duration"
        if self._on_experiment_end and experiment.ended:
            self._ended_ns = self._ended_ns or steady_ns
            if steady_ns - self._ended_ns >= _AFTER_END_NS:
                return f"experiment {experiment.outcome}"
        return ""
