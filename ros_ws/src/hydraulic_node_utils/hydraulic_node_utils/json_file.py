"""JSON files that a user names."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hydraulic_interfaces.errors import HydraulicError


def read_json(path: Path, error: type[HydraulicError]) -> Any:
    """What a JSON file holds.

    :raises error: it cannot be read, or holds no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as problem:
        raise error(f"{path}: cannot be read ({problem.strerror})") from problem
    except ValueError as problem:
        raise error(f"{path}: not a JSON document ({problem})") from problem
