"""Values with standard errors that differ by more than these: their mean, and how much they scatter of themselves.

DerSimonian & Laird (1986), Controlled Clinical Trials 7(3), 177–188: the moment estimate of the variance between.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hydraulic_sim.arrays import Array


@dataclass(frozen=True)
class Pooled:
    """Mean of a family of values, its standard error, the standard deviation between members, and their number."""

    mean: float
    error: float
    between: float
    count: int

    def distance(self, value: float, error: float) -> float:
        """How far a further value with a standard error lies off, in standard deviations; Student's t, count − 1."""
        spread = np.sqrt(error**2 + self.between**2 + self.error**2)
        return float((value - self.mean) / spread) if spread > 0.0 else 0.0


def pooled(values: Array, errors: Array) -> Pooled:
    """Mean of ``values`` (n,) with standard ``errors`` (n,), n ≥ 2, and what lies between them.

    Where the values scatter less than their errors say, nothing lies between.
    """
    floor = max(1e-12 * float(np.abs(values).max(initial=0.0)), 1e-60)
    variances = np.maximum(errors, floor) ** 2
    weights = 1.0 / variances
    mean = float(weights @ values / weights.sum())
    heterogeneity = float(weights @ (values - mean) ** 2)
    scale = float(weights.sum() - (weights**2).sum() / weights.sum())
    between = max(0.0, (heterogeneity - (len(values) - 1)) / scale) if scale > 0.0 else 0.0
    weights = 1.0 / (variances + between)
    mean = float(weights @ values / weights.sum())
    return Pooled(mean, float(1.0 / np.sqrt(weights.sum())), float(np.sqrt(between)), len(values))
