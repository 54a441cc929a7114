"""Random numbers, texts and ROS messages, of which many are at the edge of what is allowed or beyond."""

from __future__ import annotations

import math
import random
from typing import Any

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

NUMBERS = (0.0, -0.0, 1e-300, 5e-324, 1e308, -1e308, math.nan, math.inf, -math.inf, 10.0, -10.0, 10.0000001, 0.7, -0.7)
TEXTS = (
    "", " ", "\0", "a" * 5000, "é", "‮", "\n", "%s%n{0}", "../../etc/passwd", "~nobody", "$(reboot)", "'; --",
    "<script>alert(1)</script>", "servovalve", "piston", "controller", "excitation", "NaN", "1e999", "null", "true",
)  # fmt: skip
_SECOND = 1_000_000_000


def number(rng: random.Random, size: float = 1.0) -> float:
    """A number of about this size, or a strange one."""
    if rng.random() < 0.3:
        return rng.choice(NUMBERS)
    return rng.gauss(0.0, size) if rng.random() < 0.9 else rng.gauss(0.0, 1.0) * 10.0 ** rng.uniform(-320, 300)


def text(rng: random.Random) -> str:
    """A text, most often a strange one."""
    if rng.random() < 0.7:
        return rng.choice(TEXTS)
    return "".join(
        chr(rng.choice((rng.randrange(32, 127), rng.randrange(1, 0xD800)))) for _ in range(rng.randrange(30))
    )


def joints(
    rng: random.Random, stamp_ns: int, source: str, names: list[str], fields: dict[str, list[float]], strange: float
) -> JointState:
    """A joint state, with something strange in it in this share of cases."""
    message = JointState(header=Header(stamp=_time(stamp_ns), frame_id=source), name=names, **fields)
    if rng.random() < strange:
        what = rng.choice(("stamp", "source", "names", "position", "velocity", "effort"))
        if what == "stamp":
            message.header.stamp = Time(
                sec=rng.choice((0, 1, 2**31 - 1, -(2**31), rng.randrange(-(2**31), 2**31))),
                nanosec=rng.choice((0, 2**32 - 1, rng.randrange(2**32))),
            )
        elif what == "source":
            message.header.frame_id = text(rng)
        elif what == "names":
            message.name = [rng.choice((*names, text(rng))) for _ in range(rng.randrange(4))]
        else:
            setattr(message, what, [number(rng, 10.0) for _ in range(rng.randrange(4))])
    return message


def anything(rng: random.Random, depth: int = 3) -> Any:
    """A value of JSON or YAML."""
    kind = rng.randrange(9 if depth else 6)
    if kind == 0:
        return rng.choice((None, True, False))
    if kind in (1, 2):
        return rng.choice((0, -1, 1, 2**63, -(10**30), rng.randrange(-1000, 1000)))
    if kind == 3:
        return number(rng)
    if kind in (4, 5):
        return text(rng)
    if kind == 6:
        return [anything(rng, depth - 1) for _ in range(rng.randrange(4))]
    return {text(rng): anything(rng, depth - 1) for _ in range(rng.randrange(4))}


def _time(stamp_ns: int) -> Time:
    seconds, rest = divmod(stamp_ns, _SECOND)
    return Time(sec=min(max(seconds, -(2**31)), 2**31 - 1), nanosec=rest)
