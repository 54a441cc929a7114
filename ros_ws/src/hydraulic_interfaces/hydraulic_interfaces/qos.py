"""QoS profiles of the contract's classes: "stream", "latched" and "diagnostics"."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from hydraulic_interfaces.contract import find_topic

STREAM_DEPTH = 100
STREAM_HISTORY = 1000
"""Depth for a publisher at 1 kHz: a subscriber that missed a packet says so at the middleware's next heartbeat (50 ms
in the shipped profiles) and can have it again only if it is still kept then. No more than a second: what is kept for
one that cannot keep up is sent to it again, which on a busy machine costs the publisher more than its own work."""

_CLASSES = {
    "stream": (DurabilityPolicy.VOLATILE, STREAM_DEPTH),
    "latched": (DurabilityPolicy.TRANSIENT_LOCAL, 1),
    "diagnostics": (DurabilityPolicy.VOLATILE, 10),
}


def profile(name: str, depth: int | None = None) -> QoSProfile:
    """Profile of a QoS class or of a topic of the contract; `depth` replaces the default history depth.

    All are reliable and keep the last `depth`; a subscriber that must not lose a sample while its process is
    held up asks for more (a recorder at 1 kHz: some thousands).
    """
    durability, usual = _CLASSES[name if name in _CLASSES else find_topic(name).qos]
    return QoSProfile(
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
        history=HistoryPolicy.KEEP_LAST,
        depth=usual if depth is None else depth,
    )
