"""A recorded drive that is not what the valve got: noise on the channel, or changes between two samples.

Either way the drive is known but for disturbances of a known size in every segment. What they do to the channels is
simulated once and joins the nuisance, so that no fit mistakes it for physics. More freedom always leaves less: the
evidence of such a disturbance is what the sum of squares loses minus the growth of the log determinant of its
covariance (marginal likelihood; Rasmussen & Williams, Gaussian Processes for Machine Learning, section 5.4).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sysid.estimation.noise import robust_noise_std
from hydraulic_sysid.estimation.projection import Projection
from hydraulic_sysid.estimation.segments import Segments

from .linearisation import Linearisation

BENDS = 12  # of the drive in a segment, the sharpest, about which its mean between two samples is unknown
INSTANT = 3.0**-0.5  # of a sample: root mean square of how long before it a change lies that it shows first
BLOCKS = 12  # of a segment, in each of which noise on the drive has a mean of its own

Disturbed = Iterator[Array]


@dataclass(frozen=True)
class DriveHypothesis:
    """A fault of the recorded drive, its ``text`` in words and its ``remedy``.

    ``disturbances``: the drive (N,) and the indices (S, n) of the samples that each segment sees → drives (N,) that are
    off by one standard deviation each; ``size`` [``unit``] of segments: disturbances are of it if ``exact``, else up to
    it.
    """

    name: str
    text: str
    remedy: str
    unit: str
    exact: bool
    size: Callable[[Segments], float]
    disturbances: Callable[[Array, Array], Disturbed]
    channels: tuple[str, ...] = ("drive",)

    def responses(self, at: Linearisation) -> list[Array]:
        """What the disturbances do to the channels: (S, samples, C, D) per record [SI]."""
        point, found = at.point, []
        for i, (segments, states) in enumerate(zip(point.shooting.segments, point.initial_states, strict=True)):
            drive = segments.record["drive"]
            inside = segments.first[:, None] + np.arange(segments.samples - 1)

            def seen(values: Array, i: int = i, segments: Segments = segments, states: Array = states) -> Array:
                return segments.recorded(point.shooting.driven(point.plant, i, states, values))

            base = seen(drive)
            found.append(np.stack([seen(moved) - base for moved in self.disturbances(drive, inside)], axis=-1))
        return found


def disturbed(segments: Sequence[Segments], responses: Sequence[Array]) -> list[Segments]:
    """Segments in which such disturbances may be (S, samples, C, D)."""
    found = []
    for s, response in zip(segments, responses, strict=True):
        nuisance = np.concatenate((s.nuisance, s.whitened(response)), axis=-1)
        found.append(replace(s, disturbance=response, nuisance=nuisance))
    return found


def freedom(now: Sequence[Projection], before: Sequence[Projection]) -> list[Array]:
    """What the freedom that disturbances give is worth, as a cost (S,) per record."""
    return [n.log_determinant - b.log_determinant for n, b in zip(now, before, strict=True)]


def costs_with(at: Linearisation, before: Linearisation) -> list[Array]:
    """Costs (S,) per record, with what freedom that ``before`` did not have is worth.

    Such as disturbances, and what low passes held where segments begin.
    """
    worth = freedom(at.point.projections, before.point.projections)
    return [cost + own for cost, own in zip(at.costs, worth, strict=True)]


def _bends(drive: Array, inside: Array) -> Disturbed:
    change = np.diff(drive, prepend=drive[0], append=drive[-1])
    bend = np.abs(np.diff(change))  # at a sample, and so on either side of it
    bend = np.maximum(bend, np.append(bend[1:], 0.0))
    sharpest = np.argsort(-bend[inside], axis=1)[:, :BENDS]
    for place in np.take_along_axis(inside, sharpest, axis=1).T:
        moved = drive.copy()
        moved[place] += INSTANT * bend[place]
        yield moved


def _blocks(drive: Array, inside: Array) -> Disturbed:
    std = robust_noise_std(drive, rounded=False)
    for block in np.array_split(inside, BLOCKS, axis=1):
        moved = drive.copy()
        moved[block] += std / block.shape[1] ** 0.5
        yield moved


BETWEEN_SAMPLES = DriveHypothesis(
    "drive_between_samples", "the drive changed between the samples of the record, {size} apart",
    "record as often as the drive is put out", "s", False, lambda s: s.record.dt, _bends,
)  # fmt: skip
NOISY_DRIVE = DriveHypothesis(
    "drive_noise", "the recorded drive carries noise of {size} that the valve does not get",
    "record the command itself, or average its measurement over each sample", "V", True,
    lambda s: robust_noise_std(s.record["drive"], rounded=False), _blocks,
)  # fmt: skip
DRIVE_HYPOTHESES: Sequence[DriveHypothesis] = (BETWEEN_SAMPLES, NOISY_DRIVE)
