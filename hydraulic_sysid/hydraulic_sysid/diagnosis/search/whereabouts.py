"""Where what no effect explains comes from: curves over a variable, bounded by what an addition of any course would.

Or a sine that goes on whatever the drive does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hydraulic_sysid.data.display import listed, quantity

from .criteria import CRITERIA
from .nonparametric_curves import NonparametricCurve
from .periodic_inputs import PeriodicInput
from .unknown_inputs import UnknownInput

READING = "sensor"  # subsystem of the reading of the position


def nowhere(curves: Sequence[NonparametricCurve]) -> bool:
    """Whether no curve explains any part of what is left."""
    return bool(curves) and all(c.share <= CRITERIA.details for c in curves)


@dataclass(frozen=True)
class Whereabouts:
    """``curves``, unknown ``inputs`` and ``sines``, each the best first; empty of plants that take none of them.

    A curve is the best where no other explains more at a place at which something may explain nearly the most; of those
    that explain nearly as much it is that at whose place more may be explained. So it is of those that explain half as
    much where none explains the half: then none of them is the law.
    """

    curves: Sequence[NonparametricCurve] = ()
    inputs: Sequence[UnknownInput] = ()
    sines: Sequence[PeriodicInput] = ()

    @classmethod
    def of(
        cls,
        curves: Sequence[NonparametricCurve],
        inputs: Sequence[UnknownInput],
        sines: Sequence[PeriodicInput] = (),
    ) -> Whereabouts:
        """With the curves in order, which come as they explain."""
        bare = cls(curves, inputs, sines)
        possible = [c for c in curves if bare.possible(c)]
        if not possible:
            return bare
        most = possible[0].share
        least = (CRITERIA.nearly if most > CRITERIA.most_of else CRITERIA.most_of) * most
        near = [c for c in possible if c.share >= least]
        best = max(near, key=lambda c: (round(bare.bound(c.place), 2), c.share))
        return cls(sorted(curves, key=lambda c: (c is not best, not bare.possible(c))), inputs, sines)

    @property
    def sine(self) -> PeriodicInput | None:
        """What is periodic of itself: it explains the most, and more than any curve."""
        curve = max((c.share for c in self.curves), default=0.0)
        return next((s for s in self.sines[:1] if s.share > max(CRITERIA.most_of, curve)), None)

    def bound(self, place: str) -> float:
        """The share that anything at a place may explain."""
        return next((u.share for u in self.inputs if u.place == place), 1.0)

    def possible(self, curve: NonparametricCurve) -> bool:
        """Whether what may be explained at its place is nearly the most."""
        return not self.inputs or self.bound(curve.place) >= CRITERIA.nearly * self.inputs[0].share

    @property
    def place(self) -> str | None:
        """Where an addition of any course explains nearly all, and more than elsewhere; None if that is nowhere."""
        return self.inputs[0].place if self.inputs and self.inputs[0].share > CRITERIA.nearly else None

    @property
    def clear(self) -> bool:
        """Whether an addition of any course explains a part of it somewhere, and one to the position's reading less."""
        if not self.inputs or self.inputs[0].share < CRITERIA.details:
            return False
        return not any(u.subsystem == READING and u.share > CRITERIA.nearly * self.inputs[0].share for u in self.inputs)

    @property
    def subsystem(self) -> str | None:
        """Where it comes from; None if nothing is known of it.

        What acts in a plant reaches the position through its mass and its oil, so that a slow course takes up a part of
        it: what neither that nor a curve explains is in how the position is read.
        """
        if self.sine is not None:
            return self.sine.subsystem
        if nowhere(self.curves):
            return self.inputs[0].subsystem if self.clear else READING
        return self.curves[0].subsystem if self.curves else None

    def as_likely(self, best: NonparametricCurve) -> list[NonparametricCurve]:
        """The best curve of each other subsystem that explains nearly as much as the ``best`` one."""
        found: dict[str, NonparametricCurve] = {}
        for c in self.curves:
            if c.subsystem != best.subsystem and self.possible(c) and c.share > CRITERIA.nearly * best.share:
                found.setdefault(c.subsystem, c)
        return list(found.values())

    def sentence(self, best: NonparametricCurve | None, more: str = "") -> str:
        """What a user reads of it; of the ``best`` curve, where there is one.

        :param more: " more", where something else was said before
        """
        if self.sine is not None:
            return f"It looks{more} like {self._sines(self.sine)}."
        if nowhere(self.curves):
            none = f"No curve at any place of the plant would explain {100 * CRITERIA.details:.0f} % of it"
            if not self.clear:
                return f"{none}: it may be in how the motion is read."
            first, *rest = self.inputs
            near = [u for u in rest if u.subsystem != first.subsystem and u.share > CRITERIA.nearly * first.share]
            others = [f"{_course(u)} {100 * u.share:.0f} %" for u in near]
            also = f" ({', '.join(others)})" if others else ""
            return f"{none}; {_course(first)}, of any course in time, would explain {100 * first.share:.0f} %{also}."
        if best is None:
            return ""
        course = f" (of any course in time {100 * self.bound(best.place):.0f} %)" if self.inputs else ""
        said = f"It looks{more} like {_curve(best)}, which would explain {100 * best.share:.0f} % of it{course}"
        others = [f"{_curve(c)} ({100 * c.share:.0f} %)" for c in self.as_likely(best)]
        return f"{said}; nearly as much: {listed(others)}." if others else f"{said}."

    def _sines(self, best: PeriodicInput) -> str:
        near = [s for s in self.sines if s.subsystem != best.subsystem and s.share > CRITERIA.nearly * best.share]
        others = [f"{_course(s)} ({100 * s.share:.0f} %)" for s in near]
        also = f"; nearly as much: {listed(others)}" if others else ""
        by = f"at {best.frequency:.3g} Hz by about {quantity(best.amplitude, best.unit, 2)}"
        much = f"which would explain {100 * best.share:.0f} % of it"
        return f"{_course(best)} that swings {by}, whatever the drive does, {much}{also}"


NOT_KNOWN = Whereabouts()


def _curve(found: NonparametricCurve) -> str:
    return f"{found.summary} over {found.variable.replace('_', ' ')}"


def _course(found: UnknownInput | PeriodicInput) -> str:
    return found.summary.removesuffix(" of any shape")
