"""Recover a bag that was not closed: save every message that is complete.

For a recording that was killed or whose disk was full. Without --out the bag is made whole in its place, once the
result has been read back; a bag that is in order is left as it is.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from hydraulic_node_utils import cli
from hydraulic_sysid.data.bag import Recovery, recover
from hydraulic_sysid.verbs import _options as opt

EPILOG = """\
examples:
  python -m hydraulic_sysid recover runs/killed
  python -m hydraulic_sysid recover runs/killed --out runs/saved
"""


def main(argv: list[str] | None = None) -> int:
    """Entry of the verb; its exit code."""
    parser = opt.parser("recover", __doc__, EPILOG)
    parser.add_argument("bag", metavar="BAG", type=Path, help="folder of the bag")
    parser.add_argument("--out", metavar="DIR", type=Path, help="write here, a new folder, and leave BAG as it is")
    parser.add_argument("--json", action="store_true", help="print the result as JSON instead of a table")
    return cli.run(parser, _recover, argv)


def _recover(options: argparse.Namespace) -> None:
    if options.out is not None:
        cli.new_path(options.out)
    result = recover(options.bag, options.out)
    print(_as_json(result) if options.json else _as_text(result))


def _as_json(result: Recovery) -> str:
    summary = result.summary
    content = {
        "bag": str(summary.folder),
        "was_whole": result.whole,
        "messages": summary.messages,
        "start_ns": summary.start_ns,
        "duration_ns": summary.duration_ns,
        "missing": result.missing,
        "lost_bytes": result.lost_bytes,
        "damaged_records": result.damaged,
        "messages_without_topic": result.orphans,
    }
    return json.dumps(content, indent=2, ensure_ascii=False)


def _as_text(result: Recovery) -> str:
    summary = result.summary
    total = sum(summary.messages.values())
    state = "is in order, nothing was changed" if result.whole else "recovered"
    lines = [f"{summary.folder}: {state}: {total} messages over {summary.duration_ns * 1e-9:.3f} s"]
    width = max(len(name) for name in summary.messages) if summary.messages else 0
    lines += [
        f"  {name:<{width}}  {count:>9} saved  {_lost(result, name)}  {result.types.get(name, '')}"
        for name, count in sorted(summary.messages.items())
    ]
    if result.lost_bytes:
        lines.append(f"  cut off at the end: {result.lost_bytes} bytes of an incomplete record")
    if result.damaged:
        lines.append(f"  left out: {result.damaged} records that are damaged")
    if result.orphans:
        lines.append(f"  left out: {result.orphans} messages whose topic is described in a damaged record")
    return "\n".join(lines)


def _lost(result: Recovery, name: str) -> str:
    """How many are missing between the first and the last message; blank where nothing tells."""
    lost = result.missing.get(name)
    return f"{lost:>7} lost" if lost is not None else " " * 12
