"""Two runs of one command, each with the pressure of one chamber, read as one run with both.

A bench with one transducer is run twice. Each run alone leaves the other chamber's pressure free, and that takes up
what friction does; together they show the force. The runs must have been driven alike sample by sample, so that this
is for open loops alone, and where the piston moved in one and not in the other they say nothing together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.records.channels import CHAMBERS
from hydraulic_sysid.data.records.record import Record

APART = "runs_apart"
"""Channel of a pair: 1 where its two runs moved differently, else 0."""
_SAME_DRIVE = 1e-6  # of its range: what it may differ by, which is rounding
_NEAR = 0.1  # of the range of the position: root mean square by which the runs may differ
_OTHER_SPEED = 0.3  # of the highest speed: by how much more the runs move differently
_SEEN = 0.03  # of the highest speed: median by which noise may make the speeds differ that are compared
_SHORTEST = 8  # samples over which it is taken, at least


def paired(records: Sequence[Record]) -> list[Record]:
    """The records, those that are two runs of one command joined, in the order of the first of each two."""
    found, taken = list[Record](), set[int]()
    for i, record in enumerate(records):
        if i in taken:
            continue
        later = (k for k in range(i + 1, len(records)) if k not in taken)
        partner = next((k for k in later if _of_one_command(record, records[k])), None)
        if partner is not None:
            taken.add(partner)
            record = _joined(record, records[partner])
        found.append(record)
    return found


def partner_of(record: Record) -> str | None:
    """The name of the run that a pair has its other pressure from; None where a record is no pair."""
    name = record.description.get("other_pressure_from")
    return None if name is None else str(name)


def _of_one_command(one: Record, other: Record) -> bool:
    measured = [[c for c in CHAMBERS if c in r] for r in (one, other)]
    if sorted(map(len, measured)) != [1, 1] or measured[0] == measured[1]:
        return False
    if len(one) != len(other) or one.dt != other.dt or one.settings != other.settings:
        return False
    if not all(c in r for c in ("drive", "position") for r in (one, other)):
        return False
    drive, position = one["drive"], one["position"]
    if not np.ptp(drive) > 0.0 or np.abs(drive - other["drive"]).max() > _SAME_DRIVE * np.ptp(drive):
        return False
    return bool(np.sqrt(np.mean((position - other["position"]) ** 2)) <= _NEAR * np.ptp(position))


def _joined(one: Record, other: Record) -> Record:
    channel = next(c for c in CHAMBERS if c in other)
    apart = _apart(one["position"], other["position"])
    description = {**one.description, "other_pressure_from": other.name}
    channels = {**one.channels, channel: other[channel], APART: apart}
    return replace(one, channels=channels, description=description, units={**one.units, APART: "1"})


def _apart(one: Array, other: Array) -> Array:
    """(N,) 1 where the speeds of two positions differ, taken over so many samples that noise hides nothing."""
    samples, longest = _SHORTEST, max(_SHORTEST, len(one) // 8)
    while True:
        ahead, behind = (np.clip(np.arange(len(one)) + k, 0, len(one) - 1) for k in (samples // 2, -(samples // 2)))
        smooth = [uniform_filter1d(x, samples) for x in (one, other)]
        speeds = [s[ahead] - s[behind] for s in smooth]
        highest = float(max(np.abs(s).max() for s in speeds))
        differ = np.abs(speeds[0] - speeds[1])
        if samples >= longest or np.median(differ) <= _SEEN * highest:
            return np.asarray(maximum_filter1d(differ > _OTHER_SPEED * highest, samples), dtype=np.float64)
        samples *= 2
