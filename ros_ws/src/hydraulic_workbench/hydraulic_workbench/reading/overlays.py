"""A model's run on the drive of a record, beside what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from hydraulic_sim.model_file import load_model
from hydraulic_sysid.data.records import Record
from hydraulic_workbench.errors import WorkbenchError
from hydraulic_workbench.reading.records import curve, records_of, window

HORIZON_S = 0.5


def simulated(
    model: Path, file: Path, columns: Path | None, channels: Sequence[str], start: float | None, end: float | None,
    points: int,
) -> dict[str, Any]:  # fmt: skip
    """Curves of the free run, of the channels that the model predicts."""
    record = _free_run(model, model.stat().st_mtime, file, columns)
    part, span = window(record, start, end)
    chosen = [name for name in channels or record.channels if name in record]
    if not chosen:
        raise WorkbenchError(f"the model predicts none of {', '.join(channels)}", "channels")
    return {**span, "channels": {name: curve(record, name, part, points) for name in chosen}}


@lru_cache(maxsize=4)
def _free_run(model: Path, changed: float, file: Path, columns: Path | None) -> Record:
    from hydraulic_sysid.diagnosis.compare import ModelSubject  # takes long to import; the server itself needs none
    from hydraulic_sysid.diagnosis.compare.reference_run import run

    record = records_of(file, columns)[0]
    free = run(ModelSubject(load_model(model)), record, HORIZON_S).runs.free_run
    known = {name: values for name, values in free.items() if name in record}
    return Record.sampled(f"{model.stem} on {record.name}", record.dt, known)
