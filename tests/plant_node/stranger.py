"""Somebody on another machine, who looks for plants: `stranger.py domain domain`.

Says "found DOMAIN" for each one in whose domain the state of a plant is published, until its input ends.
"""

from __future__ import annotations

import sys
import threading
import time

import rclpy


def main() -> None:
    """Look into all domains at once."""
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    nodes = {}
    for domain in map(int, sys.argv[1:]):
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        nodes[domain] = rclpy.create_node("stranger", context=context)
    print("looking", flush=True)
    while not ended.is_set():
        for domain in list(nodes):
            if nodes[domain].count_publishers("/actuator/state") or "plant" in nodes[domain].get_node_names():
                print("found", domain, flush=True)
                del nodes[domain]
        time.sleep(0.05)


if __name__ == "__main__":
    main()
