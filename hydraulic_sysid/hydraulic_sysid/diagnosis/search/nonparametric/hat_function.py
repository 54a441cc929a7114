"""What the unknown additions have in common: a hat function of some height at one place of one variable.

Beside its ``EFFECT`` each file names the ``VARIABLES``, and in ``RETURNS`` what a kernel returns that has any other
``law`` in the place of the hat function (by variable, where that makes a difference); ``EXPRESSIONS`` has the variables
that go by another name there than elsewhere.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from hydraulic_sim.effect import Effect, Parameter

_SOURCE = "curve of a residual"
_NEVER = 1e12  # s


def effect(
    slot: str, kernel: Callable, unit: str, size: float, most: float, order: int, shape: tuple[Parameter, ...] = (),
    passive: bool = False, **more: Any,
) -> Effect:
    """An effect whose kernel takes over, centre, width and height of a hat function.

    One over the time takes the period after which it begins again, too (by default never). Summary and equation are the
    first two paragraphs of the file's docstring; ``size``, which is tried, and ``most``, its bound, are in ``unit``;
    ``shape``: parameters besides; ``passive``: it may not be negative, since that would feed itself, as a leak that
    flows uphill; ``more``: fields of the effect.
    """
    least = 0.0 if passive else -most
    if "period" in inspect.signature(kernel).parameters:
        again = "time after which the time begins again"
        shape = (*shape, Parameter("period", "s", _NEVER, (1e-12, _NEVER), again, _SOURCE, free=False))
    summary, equation, *_ = inspect.cleandoc(kernel.__globals__["__doc__"]).split("\n\n")
    return Effect(
        slot=slot,
        summary=summary[:1].lower() + summary[1:].rstrip("."),
        kernel=kernel,
        parameters=(
            Parameter("height", unit, size, (least, most), "height of the hat function", _SOURCE, null=0.0),
            Parameter("over", "1", 0.0, (0.0, 9.0), "the variable's place in VARIABLES", _SOURCE, free=False),
            Parameter("centre", "1", 0.0, (-1e12, 1e12), "the variable at the top [its unit]", _SOURCE, free=False),
            Parameter("width", "1", 1.0, (1e-12, 1e12), "half the foot [the variable's unit]", _SOURCE, free=False),
            *shape,
        ),
        equation=equation.strip(),
        source="de Boor (1978), A Practical Guide to Splines, ch. III",
        excited_by="whatever moves the variable",
        confused_with=(),
        distinguished_by="the variable over which the curve explains most",
        order=order,
        **more,
    )
