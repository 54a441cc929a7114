"""The table of a campaign: one row for each case, as CSV or Parquet."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydraulic_node_utils.whole_file import write_text
from hydraulic_sysid.campaign.outcome import Outcome

FORMATS = ("csv", "parquet")


def rows(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Labels, state, figures, costs and error of each case; every row has every column."""
    found = [
        {
            **o.labels,
            "state": o.state,
            **o.row,
            "error": o.error,
            "seconds": o.seconds,
            "cpu_seconds": o.cpu_seconds,
            "peak_mib": o.peak_mib,
            "key": o.key,
        }
        for o in outcomes
    ]
    columns = dict.fromkeys(name for row in found for name in row)
    return [{name: row.get(name) for name in columns} for row in found]


def write_table(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write the table in the format that the file's suffix names (`FORMATS`), replacing an earlier one."""
    found = rows(outcomes)
    if path.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        columns = {name: _of_one_kind([row[name] for row in found]) for name in (found[0] if found else {})}
        sink = io.BytesIO()
        pq.write_table(pa.table(columns), sink)
        write_text(path, sink.getvalue())
        return
    text = io.StringIO()
    writer = csv.DictWriter(text, list(found[0]) if found else ["state"])
    writer.writeheader()
    writer.writerows(found)
    write_text(path, text.getvalue())


def _of_one_kind(values: list[Any]) -> list[Any]:
    """A column as numbers where all are, else as texts."""
    kinds = {type(v) for v in values if v is not None}
    if kinds <= {int, float} or kinds <= {bool} or kinds <= {str}:
        return [float(v) for v in values] if kinds == {int, float} and None not in values else values
    return [None if v is None else str(v) for v in values]
