"""Records cut into segments, and which of them are for fitting, which for validation, and which for a test.

Where no validation records are named, every third block of a few segments of every record is for validation, so that
both have seen the same experiments; segments for validation never enter a fit, but they steer what is added. Of records
that have more values than do, blocks are left out, evenly, so that memory and time are bounded. Test data neither enter
a fit nor steer anything: records that are named, or else some of the blocks that were left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from scipy.ndimage import maximum_filter1d

from hydraulic_sim.arrays import Array, Index, Mask
from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.slower import slower
from hydraulic_sysid.diagnosis.check import resonance
from hydraulic_sysid.estimation.errors import SegmentError
from hydraulic_sysid.estimation.refinement import but_accidents
from hydraulic_sysid.estimation.segments import MEASURED, Segments, cut, spread

from .criteria import CRITERIA
from .set_aside import SetAside, set_aside

BLOCK = 3  # segments in a row that have the same role
EVERY = 3  # one block in so many is for validation
MOST_VALUES = 80_000  # measured values of all segments, spread: 27 s of three channels at 1 kHz; more hardly say more …
QUICK_VALUES = 24_000  # … and for an answer in seconds; what is small is missed, …
QUICK_SECONDS = 8.0  # … and of fewer channels or at lower rates so many seconds, over which a fit takes as long, …
QUICK_LEAST = 6_000  # … that hold so many values
BEYOND = 0.1  # of a range that was taken: what goes further is taken, too, …
MOST_BEYOND = 4  # … in so many blocks
TEST_VALUES = 20_000  # measured values of all segments for a test, spread over what is left to test on
DENSE = 500  # samples of a segment that do, if the model's resonance has …
PER_PERIOD = 5.0  # … so many samples in a period


@dataclass(frozen=True)
class Split:
    """All segments, and per record which are for fitting: ``fit[i]`` (S_i,) of ``segments[i]``."""

    segments: list[Segments]
    fit: list[Mask]
    set_aside: Sequence[SetAside] = ()
    """What of the records is not judged at all."""
    far_off: Sequence[Segments] = ()
    """Segments that were left out, since the model was far off in these few alone, …"""
    whole: Split | None = None
    """… and the split before any was."""
    to_test: Sequence[Segments] = ()
    """Test data, judged by nothing yet."""

    @property
    def to_fit(self) -> list[Segments]:
        """The segments that a fit sees, without records of which it sees none."""
        return [s.subset(f) for s, f in zip(self.segments, self.fit, strict=True) if f.any()]

    def some(self, most: int) -> list[Segments]:
        """About ``most`` of those that a fit sees, spread over all records."""
        return spread(self.to_fit, most)

    def records(self, validation: bool = False) -> list[Record]:
        """Those of which at least a part is fitted, or those that are named for ``validation``."""
        return [s.record for s, f in zip(self.segments, self.fit, strict=True) if bool(f.any()) != validation]

    def tested(self) -> list[Record]:
        """Those that are for the test alone, as those that are named for it."""
        known = {s.record.name for s in self.segments}
        return [s.record for s in self.to_test if s.record.name not in known]

    def judged(self, segments: Sequence[Segments], near: Sequence[Mask]) -> Split:
        """The same roles for segments of which more is known, without the few that are not ``near[i]`` (S_i,).

        Where they become more than a few, those that were left out before are no accidents either: all are back.
        """
        usable = but_accidents(near, sum(len(s) for s in self.far_off))
        more = all(u.all() for u in usable) and not all(n.all() for n in near)
        if more and self.whole is not None and not any(s.disturbance.shape[-1] for s in segments):
            return self.whole.known_from(segments)
        kept = [s.subset(u) for s, u in zip(segments, usable, strict=True)]
        far = [s.subset(~u) for s, u in zip(segments, usable, strict=True) if not u.all()]
        fit = [f[u] for f, u in zip(self.fit, usable, strict=True)]
        whole = self.whole if self.whole is not None or not far else self
        return replace(self, segments=kept, fit=fit, far_off=[*self.far_off, *far], whole=whole)

    def known_from(self, judged: Sequence[Segments]) -> Split:
        """The same segments with the noise and the readings of those that were ``judged``, some of the same records."""
        both = list(zip(self.segments, judged, strict=True))
        return replace(self, segments=[replace(s.with_noise(j.noise), readings=j.readings, hum=j.hum) for s, j in both])

    def __len__(self) -> int:
        return sum(map(len, self.segments))

    def shared_out(self, squares: Sequence[Array]) -> Split:
        """The same segments, those that leave much in both roles, where nearly all of them were of one.

        What acts at a limit may act in a few segments alone. Records that are wholly of one role, as named, stay so.

        :param squares: (S_i,) mean square over noise of each segment per record
        """
        mixed = [bool(f.any() and not f.all()) for f in self.fit]
        if not any(mixed):
            return self
        every, fitted = np.concatenate(list(squares)), np.concatenate(self.fit)
        beyond = [max(float(np.mean(every[role])) - 1.0, 0.0) for role in (fitted, ~fitted)]
        if max(beyond) < CRITERIA.lopsided * min(beyond) or max(beyond) < CRITERIA.lopsided_beyond:
            return self
        fit, number = [], 0
        most = CRITERIA.much_in_a_segment * float(np.median(every))
        for own, f, both in zip(squares, self.fit, mixed, strict=True):
            much = np.flatnonzero(own > most) if both else np.zeros(0, dtype=int)
            shared = f.copy()
            shared[much] = (number + np.arange(much.size)) % EVERY != 1
            number += much.size
            fit.append(shared)
        return replace(self, fit=fit)

    @property
    def interval(self) -> float:
        """The shortest sampling interval of the records [s]."""
        return min(s.record.dt for s in self.segments)

    @property
    def channels(self) -> list[str]:
        """All that are fitted in any record."""
        return list(dict.fromkeys(c for s in self.segments for c in s.channels))


def split(
    records: Sequence[Record],
    validation: Sequence[Record],
    model: Model,
    length: float,
    quick: bool = False,
    test: Sequence[Record] = (),
) -> Split:
    """Cut ``records`` and those for ``validation`` into segments of ``length`` seconds, what is `set_aside` left out.

    Records with more than `MOST_VALUES`, or for a ``quick`` answer `QUICK_VALUES`, are taken at a lower rate, as far as
    the model's resonance allows, and of what is still more, or longer, blocks are left out.

    :param test: records to test on; by default what is left out
    :raises hydraulic_sysid.estimation.errors.SegmentError: a record cannot be cut.
    """
    most, number = QUICK_VALUES if quick else MOST_VALUES, len(records) + len(validation)
    every = [*records, *validation, *test]
    for record in every:
        record.require("drive", "position", error=SegmentError)
    masks, aside = set_aside(model, every, length)
    factors = _factors(model, every[:number], masks[:number], length, most)
    # One to test on is taken at the rate of what is fitted, as noise is that of a rate.
    rates = {r.dt: k for r, k in zip(every, factors, strict=False)}
    factors += [rates.get(r.dt, 1) for r in test]
    slow = [slower(r, k) for r, k in zip(every, factors, strict=True)]
    masks = [_reduced(m, k, len(r)) for m, k, r in zip(masks, factors, slow, strict=True)]
    cuts = cut(slow, model.kind, length, left_out=masks)
    segments, used, left = _thinned(cuts[:number], quick)
    to_test = _spread(cuts[number:] if test else left, TEST_VALUES)
    if validation:
        named: list[Mask] = [np.full(len(s), i < len(records)) for s, i in zip(segments, used, strict=True)]
        return Split(segments, named, aside, to_test=to_test)
    # Shifted from record to record, so that not always the same phase of an experiment is for validation.
    alternating = [_alternate(np.arange(len(s)), i) for s, i in zip(segments, used, strict=True)]
    return Split(segments, alternating, aside, to_test=to_test)


def _factors(
    model: Model, records: Sequence[Record], left_out: Sequence[Mask], length: float, most: int
) -> list[int]:
    """By how much each record is slowed down: as its values ask for, and its segments and the oil allow."""
    values = [int((~m).sum()) * sum(c in r for c in MEASURED) for m, r in zip(left_out, records, strict=True)]
    wanted = int(sum(values) / most)
    if wanted <= 1:
        return [1] * len(records)
    slowest = max(DENSE / length, PER_PERIOD * (resonance(model) or 0.0))
    return [max(1, min(wanted, int(1.0 / (slowest * r.dt) + 1e-6))) for r in records]


def _reduced(left_out: Mask, factor: int, count: int) -> Mask:
    """Of the samples that are kept: those whose smoothing saw one that is left out."""
    if factor <= 1:
        return left_out
    return np.asarray(maximum_filter1d(left_out, 3 * factor)[: count * factor : factor])


def _thinned(segments: list[Segments], quick: bool) -> tuple[list[Segments], list[int], list[Segments]]:
    """One block in so many of all records, if there is more than is used, of which records they are, and the rest.

    And the few that go beyond those, unless it is to be ``quick``: a cushion or a limit may act nowhere else.
    """
    values = sum(s.measured.size for s in segments)
    seconds = sum(len(s) * s.samples * s.record.dt for s in segments)
    times = max(values / QUICK_VALUES, min(seconds / QUICK_SECONDS, values // QUICK_LEAST))
    every = ceil(times if quick else values / MOST_VALUES)
    blocks = _blocks(segments)
    taken = np.concatenate(blocks) % every == 0
    if not (quick or taken.all()):
        taken = _with_extremes(taken, np.concatenate(blocks), _ranges(segments))
    chosen = np.split(taken, np.cumsum([len(s) for s in segments])[:-1])
    kept = [s.subset(c) if every > 1 else s for s, c in zip(segments, chosen, strict=True) if c.any()]
    left = [s.subset(~c) for s, c in zip(segments, chosen, strict=True) if not c.all()]
    return kept, [i for i, c in enumerate(chosen) if c.any()], left


def _ranges(segments: Sequence[Segments]) -> Array:
    """(S, 5, 2) lowest and highest position, velocity, pressures and drive in each segment, NaN where not measured."""
    found = []
    for s in segments:
        inside = s.first[:, None] + np.arange(s.samples)
        every = np.column_stack((s.smoothed, s.record["drive"]))[inside]
        found.append(np.stack((every.min(axis=1), every.max(axis=1)), axis=-1))
    return np.concatenate(found)


def _with_extremes(taken: Mask, block: Index, ranges: Array) -> Mask:
    """The segments (S,) ``taken`` and those of the blocks that go furthest beyond what these see."""
    taken, lowest, highest = taken.copy(), ranges[..., 0], ranges[..., 1]
    for _ in range(MOST_BEYOND):
        low = np.min(lowest, axis=0, where=taken[:, None] & np.isfinite(lowest), initial=np.inf)
        high = np.max(highest, axis=0, where=taken[:, None] & np.isfinite(highest), initial=-np.inf)
        seen = np.isfinite(ranges).all(axis=-1) & (high > low)
        beyond = np.where(seen, np.maximum(low - lowest, highest - high) / np.where(high > low, high - low, 1.0), 0.0)
        furthest = np.where(taken, 0.0, beyond.max(axis=1))
        if furthest.max() <= BEYOND:
            break
        taken |= block == block[np.argmax(furthest)]
    return taken


def _spread(segments: list[Segments], most: int) -> list[Segments]:
    """One block in so many of these, for no more than about so many values."""
    every = max(1, ceil(sum(s.measured.size for s in segments) / most))
    chosen = [(block + i) % every == 0 for i, block in enumerate(_blocks(segments))]  # not each time the same phase
    return [s.subset(c) for s, c in zip(segments, chosen, strict=True) if c.any()]


def _blocks(segments: Sequence[Segments]) -> list[Index]:
    """The block (S,) that each segment is in, counted on from record to record: not the first of each is kept."""
    found, before = list[Index](), 0
    for s in segments:
        found.append(before + np.arange(len(s)) // BLOCK)
        before += ceil(len(s) / BLOCK)
    return found


def _alternate(number: Index, shift: int) -> Mask:
    """Which segments of one record are for fitting; a record of very few is fitted whole."""
    if number.size >= EVERY * BLOCK:
        return (number // BLOCK + shift) % EVERY != EVERY - 1
    return number % EVERY != EVERY - 1 if number.size >= EVERY else np.ones(number.size, dtype=bool)
