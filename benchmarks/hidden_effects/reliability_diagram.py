"""The reliability diagram: how often verdicts are right, against the probability that they state."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from . import scoring


def reliability_diagram(marks: list[dict[str, Any]], path: Path) -> Path:
    """A PNG of `scoring.reliability`: a point per bin, with its 95 % interval (Wilson) and its number of verdicts.

    :raises ValueError: no verdict states a probability.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    bins = scoring.reliability(marks)
    if not bins:
        raise ValueError("no verdict states a probability: there is nothing to draw")
    figure = Figure(figsize=(5.6, 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    ax.plot((0, 100), (0, 100), color="0.6", linewidth=1.0, label="as said")
    for number, (_, _, right, count, mean) in enumerate(bins):
        share, (low, high) = right / count, scoring.wilson(right, count)
        spread = [[100 * (share - low)], [100 * (high - share)]]
        ax.errorbar(
            100 * mean, 100 * share, yerr=spread, fmt="o", color="tab:blue", capsize=3,
            label="" if number else "measured, 95 % interval",
        )  # fmt: skip
        # The bins lie close together near 100 %: their counts take turns on either side.
        left = number % 2
        ax.annotate(
            str(count), (100 * mean, 100 * share), xytext=(-6 if left else 6, -3), textcoords="offset points",
            ha="right" if left else "left", fontsize=8,
        )  # fmt: skip
    ax.set(xlim=(0, 102), ylim=(-2, 102), xlabel="said: probability of a verdict, %", ylabel="right, %")
    ax.set_title(f"{sum(b[3] for b in bins)} verdicts; the number at each point", fontsize=10)
    figure.legend(loc="outside lower center", ncols=2, fontsize=9)
    ax.grid(alpha=0.3)
    figure.savefig(path, dpi=100)
    return path
