"""An FMU of anybody as the subject of a comparison.

Its inner states cannot be set to what was measured. Its free run begins as measured as far as the FMU can be begun; a
start within the record sets the position to what was measured, and all else is as in the free run at that instant. That
is the same prediction wherever the position itself hardly matters to what follows.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array, Index
from hydraulic_sim.exchange.foreign import CHANNELS, DRIVE, ForeignFmu
from hydraulic_sysid.data.records import Record

from .channels import Measured, Scales
from .subject import start_values


class FmuSubject:
    """An FMU to be compared with records."""

    def __init__(self, fmu: ForeignFmu) -> None:
        self.fmu = fmu
        a, b = fmu.parameter("piston_area_a"), fmu.parameter("piston_area_b")
        self.scales = Scales(b / a if a and b else None, fmu.parameter("spool_travel") or 1.0)

    def seen(self, record: Record) -> Record:
        """The record without the channels that the FMU does not give."""
        own = {DRIVE, *self.fmu.channels}
        kept = {name: v for name, v in record.channels.items() if name in own or name not in CHANNELS}
        return replace(record, channels=kept)

    def runs(self, data: Measured) -> FmuRuns:
        """The FMU; nothing of it is kept between runs."""
        return FmuRuns(self.fmu)

    def document(self) -> dict[str, Any]:
        """Name, file and what the FMU says of itself."""
        about = [self.fmu.description, f"FMU made by {self.fmu.tool}" if self.fmu.tool else "FMU"]
        return {
            "name": self.fmu.name,
            "path": str(self.fmu.path),
            "description": "; ".join(part for part in about if part),
            "effects": [],
            "parameters": [],
            "history": [],
            "fmu": True,
        }


class FmuRuns:
    """An FMU beside a record; its free run is made once for each set of measurements."""

    def __init__(self, fmu: ForeignFmu) -> None:
        self._fmu = fmu
        self._last: tuple[Measured, dict[str, Array]] | None = None

    def free(self, data: Measured) -> dict[str, Array]:
        """The FMU over the whole drive, its position shifted to where the record begins."""
        return dict(self._free(data))

    def _free(self, data: Measured) -> dict[str, Array]:
        if self._last is None or self._last[0] is not data:
            first = {name: float(values[0]) for name, values in start_values(data, smoothed=True).items()}
            initial = {f"initial.{name}": value for name, value in first.items()}
            found = self._fmu.simulate(data.record[DRIVE], data.record.dt, initial)
            if not self._fmu.settable("initial.position"):
                found["position"] = found["position"] + (first["position"] - found["position"][0])
            self._last = data, found
        return self._last[1]

    def ahead(self, data: Measured, starts: Index, count: int, smoothed: bool) -> dict[str, Array]:
        """Each run is a part of the free run, moved to the position that was measured at its start."""
        index = starts[:, None] + np.arange(count + 1)
        found = {name: values[index] for name, values in self._free(data).items()}
        begun = start_values(data, smoothed)["position"][starts]
        found["position"] = found["position"] + (begun - found["position"][:, 0])[:, None]
        return found
