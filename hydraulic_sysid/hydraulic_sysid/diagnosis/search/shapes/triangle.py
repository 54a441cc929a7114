"""What the unknown additions have in common: a triangle of some height at one place of one variable."""

from __future__ import annotations

from collections.abc import Callable

from hydraulic_sim.effect import Effect, Parameter

_SOURCE = "shape of a residual"


def curve(
    *, slot: str, summary: str, kernel: Callable, unit: str, size: float, bounds: tuple[float, float], equation: str,
    order: int,
) -> Effect:  # fmt: skip
    """An effect in ``slot`` whose kernel takes over, centre, width and height of a triangle.

    ``size`` and ``bounds`` of the height are in ``unit``; ``size`` is what is tried.
    """
    return Effect(
        slot=slot,
        summary=summary,
        kernel=kernel,
        parameters=(
            Parameter("height", unit, size, bounds, "height of the triangle", _SOURCE, null=0.0),
            Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", _SOURCE, free=False),
            Parameter("centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", _SOURCE, free=False),
            Parameter("width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", _SOURCE, free=False),
        ),
        equation=equation,
        source="de Boor (1978), A Practical Guide to Splines, ch. III",
        excited_by="whatever moves the variable",
        confused_with=(),
        told_apart_by="the variable over which the curve explains most",
        order=order,
    )
