"""Scattered copies of a model, for Monte Carlo studies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .errors import ModelError
from .model import Model


def scatter(model: Model, relative: Mapping[str, float], count: int, seed: int) -> list[Model]:
    """``count`` copies of a model with scattered parameters, for Monte Carlo studies.

    ``relative``: key → standard deviation relative to the model's value; drawn normal, cut at three deviations and
    at the library's bounds. The same seed gives the same models.

    :raises ModelError: an unknown key or a negative deviation.
    """
    for key, deviation in relative.items():
        model.parameter(key)
        if not deviation >= 0.0:
            raise ModelError(f"scatter of {key}: the relative deviation {deviation} is negative")
    generator = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        values = {}
        for key, deviation in relative.items():
            low, high = model.parameter(key).bounds
            factor = 1.0 + deviation * float(np.clip(generator.standard_normal(), -3.0, 3.0))
            values[key] = float(np.clip(model.value(key) * factor, low, high))
        made.append(model.with_values(values))
    return made
