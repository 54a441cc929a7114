"""Every sample behind the error maps of a comparison, in one file: for who asks which samples made an error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .comparison import variables_of
from .reference_run import Compared


def write_samples(compared: Sequence[Compared], file: Path) -> None:
    """NumPy archive: by place of the record ``time``, ``error/CHANNEL`` of the horizon, ``variable/NAME``; ``(N,)``."""
    arrays: dict[str, Any] = {}
    for place, c in enumerate(compared):
        arrays[f"{place}/time"] = c.data.record.time
        arrays |= {f"{place}/error/{name}": c.error("horizon", name).astype(np.float32) for name in c.data.compared}
        arrays |= {f"{place}/variable/{n}": values for n, values in variables_of(c).items()}
    np.savez(file, **arrays)
