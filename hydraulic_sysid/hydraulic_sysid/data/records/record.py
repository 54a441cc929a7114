"""A record: the channels of one experiment, sampled together and evenly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.data.errors import ChannelError, RecordError
from hydraulic_sysid.data.records.channels import CHANNELS, allowed


@dataclass(frozen=True, eq=False)
class Record:
    """Channels over one uniform time: those of `CHANNELS` in SI units, others in the unit that ``units`` gives.

    ``time`` is ``(N,)``, starts at 0 and steps by ``dt``; every channel is ``(N,)`` and read-only. A channel
    that was not measured is absent. ``description`` can be written as JSON; its ``notes`` say in words what
    the reader assumed or left out.

    :raises RecordError: lengths differ, a value is not finite, or the time is not ``0, dt, 2·dt, …``.
    :raises ChannelError: a name that is no channel.
    """

    name: str
    time: Array
    dt: float
    channels: dict[str, Array]
    source: Path = Path()
    description: dict[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", _frozen(self.time, self.name, "time"))
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise RecordError(f"{self.name}: dt is {self.dt!r} s, must be positive")
        if self.time.size < 2:
            raise RecordError(f"{self.name}: {self.time.size} samples; a record needs at least two")
        if np.abs(self.time - self.dt * np.arange(self.time.size)).max() > 1e-6 * self.dt:
            raise RecordError(f"{self.name}: the time is not 0, dt, 2·dt, … with dt = {self.dt:g} s")
        channels = {}
        for name, values in self.channels.items():
            if name not in CHANNELS and name not in self.units:
                raise ChannelError(
                    f"{self.name}: {name!r} is no channel; allowed: {allowed()}, or a name with a unit of its own"
                )
            channels[name] = _frozen(values, self.name, name)
            if channels[name].size != self.time.size:
                sizes = f"{channels[name].size} samples, the time {self.time.size}"
                raise RecordError(f"{self.name}: channel {name} has {sizes}")
        object.__setattr__(self, "channels", channels)

    @classmethod
    def sampled(
        cls,
        name: str,
        dt: float,
        channels: Mapping[str, Array],
        source: Path = Path(),
        description: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
    ) -> Record:
        """The record of channels that were sampled every ``dt`` seconds."""
        count = len(next(iter(channels.values()), ()))
        return cls(
            name,
            dt * np.arange(count, dtype=np.float64),
            dt,
            dict(channels),
            source,
            dict(description or {}),
            dict(units or {}),
        )

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __getitem__(self, channel: str) -> Array:
        """Samples ``(N,)`` of a channel; ChannelError names those there are."""
        try:
            return self.channels[channel]
        except KeyError:
            there = ", ".join(self.channels)
            raise ChannelError(f"{self.name} has no channel {channel!r}; it has {there}") from None

    def require(self, *channels: str, error: type[Exception] = ChannelError) -> None:
        """Check that these channels are there.

        :raises error: one is missing; the text names those there are.
        """
        for channel in channels:
            if channel not in self:
                raise error(f"{self.name}: no channel {channel!r}; the record has {', '.join(sorted(self.channels))}")

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """Seconds, N·dt: every sample stands for one period."""
        return len(self) * self.dt

    def unit(self, channel: str) -> str:
        """Unit of a channel: SI, or its own where ``units`` gives one."""
        return self.units[channel] if channel in self.units else CHANNELS[channel].unit

    @property
    def settings(self) -> dict[str, float]:
        """What the record states of the machine while it was made: key of a model's parameter → value [SI].

        A load that was put on, a gain that was set, a motor that was switched off: every plant that is set beside this
        record has these values, whatever the model file says.

        :raises RecordError: a value that is no finite number.
        """
        found = self.description.get("settings", {})
        for key, value in found.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
                raise RecordError(f"{self.name}: the setting {key} is {value!r}, must be a finite number")
        return {str(key): float(value) for key, value in found.items()}

    @property
    def notes(self) -> list[str]:
        """What the reader assumed or left out."""
        return list(self.description.get("notes", ()))

    def window(self, start: float, end: float) -> Record:
        """Samples with ``start ≤ time < end`` in seconds, as a record whose time starts at 0 again.

        ``description["window_s"]`` says where it lay in the whole record.

        :raises RecordError: fewer than two samples lie in the window.
        """
        # A bound that is meant to be a sample's time and misses it by rounding still counts as that time.
        first, last = (int(np.ceil(bound / self.dt - 1e-6)) for bound in (start, end))
        return self._cut(max(first, 0), min(last, len(self)), f"{start:g} … {end:g} s")

    def split(self, fraction: float) -> tuple[Record, Record]:
        """The first ``fraction`` (0 … 1) of the samples, and the rest.

        :raises RecordError: a part would have fewer than two samples.
        """
        if not 0.0 < fraction < 1.0:
            raise RecordError(f"{self.name}: cannot split at {fraction!r}, must be between 0 and 1")
        at = round(fraction * len(self))
        return self._cut(0, at, f"first {fraction:g}"), self._cut(at, len(self), f"after the first {fraction:g}")

    def _cut(self, first: int, last: int, what: str) -> Record:
        if last - first < 2:
            raise RecordError(
                f"{self.name}: no two samples in {what}; it has {len(self)} samples over {self.duration:g} s"
            )
        offset = self.description.get("window_s", (0.0, 0.0))[0]
        span = [round(offset + index * self.dt, 9) for index in (first, last)]
        return replace(
            self,
            name=f"{self.name.partition('[')[0]}[{span[0]:g}–{span[1]:g} s]",
            time=self.time[: last - first],
            channels={name: values[first:last] for name, values in self.channels.items()},
            description={**self.description, "window_s": span},
        )


def _frozen(values: Any, record: str, channel: str) -> Array:
    array = np.array(values, dtype=np.float64)
    if array.ndim != 1:
        raise RecordError(f"{record}: {channel} has shape {array.shape}, must be (N,)")
    if not np.isfinite(array).all():
        index = int(np.flatnonzero(~np.isfinite(array))[0])
        raise RecordError(f"{record}: {channel} is {array[index]} at sample {index + 1}; must be finite")
    array.flags.writeable = False
    return array
