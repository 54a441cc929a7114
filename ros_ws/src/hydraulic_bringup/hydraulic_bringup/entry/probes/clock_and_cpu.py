"""Clock and CPU: how well a control loop can keep its period here."""

from __future__ import annotations

import os
import resource
import time
from pathlib import Path

from ..bench import Bench
from ..findings import NOTE, Finding

TITLE = "Clock and CPU"
ORDER = 4

PERIOD_S = 0.001
TICKS = 300
JITTER_LIMIT_S = 0.0003  # of the plant loop at 1 kHz, 99th percentile


def probe(bench: Bench) -> list[Finding]:
    """Clocks, lateness of a 1 kHz loop, processors, real-time rights."""
    return [_clock(), _jitter(), _processors(), _priority()]


def lateness(ticks: int, period: float) -> list[float]:
    """How late a loop on absolute deadlines wakes up, sorted; `ticks` values in s."""
    late = []
    start = time.monotonic()
    for tick in range(1, ticks + 1):
        deadline = start + tick * period
        time.sleep(max(0.0, deadline - time.monotonic()))
        late.append(time.monotonic() - deadline)
    return sorted(late)


def _clock() -> Finding:
    info = time.get_clock_info("monotonic")
    source = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource")
    kernel = source.read_text().strip() if source.is_file() else "unknown"
    found = f"monotonic, resolution {info.resolution * 1e9:.0f} ns, kernel source {kernel}"
    slow = kernel in ("hpet", "acpi_pm", "jiffies")
    return Finding(
        "clock",
        found,
        "a slow clock source: every reading costs 1 µs and more" if slow else "",
        NOTE if slow else "ok",
    )


def _jitter() -> Finding:
    late = lateness(TICKS, PERIOD_S)
    median, high = late[len(late) // 2], late[int(0.99 * len(late))]
    found = f"1 kHz loop wakes {median * 1e3:.2f} ms late (median), {high * 1e3:.2f} ms (p99)"
    poor = high > JITTER_LIMIT_S
    return Finding(
        "sleep",
        found,
        "close other programs; on a laptop plug in the power" if poor else "",
        NOTE if poor else "ok",
    )


def _processors() -> Finding:
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    file = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
    governor = file.read_text().strip() if file.is_file() else "not shown by this machine"
    found = f"{usable} usable, governor {governor}"
    if usable < 2:
        return Finding("processors", found, "1 kHz with recording wants two", NOTE)
    if governor == "powersave":
        return Finding("processors", found, "sudo cpupower frequency-set -g performance", NOTE)
    return Finding("processors", found)


def _priority() -> Finding:
    soft, _ = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if soft or os.geteuid() == 0:
        return Finding("real time", "real-time priority is allowed")
    remedy = "only for hardware at 1 kHz on a busy machine: rtprio in /etc/security/limits.d"
    return Finding("real time", "no real-time priority", remedy, NOTE)
