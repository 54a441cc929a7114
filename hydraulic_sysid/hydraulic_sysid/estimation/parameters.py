"""Which parameters a fit may move, how large each is, and how far it may go."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import Parameter
from hydraulic_sim.model import Model
from hydraulic_sim.typical import typical

Priors = Mapping[str, tuple[float, float]]
"""What is known of parameters beforehand: key → mean and standard deviation [SI]."""
NO_PRIORS: Priors = {}
_SCATTER = 2.0  # factor by which a plant may be off a data sheet that states no bounds
_TURN = 2.0 * np.pi
_AT_BOUND = 1e-6  # distance from a bound, of the scale


def scale(model: Model, key: str) -> float:
    """The size of a parameter: of its value, or of what is typical of the plant where that is larger.

    Where the library knows no typical value, as of a mass, its value alone; where both are 0, as an angle may be, a
    hundredth of its range.
    """
    parameter = model.parameter(key)
    low, high = parameter.bounds
    owner = key.rpartition(".")[0]
    slot = model.library[owner].slot if owner else ""
    usual = 0.0 if parameter.required else abs(typical(model, parameter, slot))
    return max(abs(model.value(key)), usual) or 0.01 * (high - low)


def turns(parameter: Parameter) -> bool:
    """Whether it is an angle that may go all the way round."""
    return parameter.unit == "rad" and parameter.bounds[1] - parameter.bounds[0] >= _TURN


def clocked(model: Model, key: str) -> bool:
    """Whether it is the frequency of what goes on by itself, with a phase beside it: what it is off adds up."""
    owner = key.rpartition(".")[0]
    beside = model.library[owner].parameters if owner else ()
    return model.parameter(key).unit == "Hz" and any(turns(p) for p in beside)


def bounded(model: Model) -> Model:
    """The model with bounds on free base parameters whose file gives none: half to twice their value.

    While an effect is missing, a fit would else bend a mass or a flow to many times what a data sheet says.
    """
    for key in model.free_keys():
        own = model.entries.get(key)
        if "." not in key and own is not None and own.bounds is None and own.value > 0.0:
            low, high = model.parameter(key).bounds
            model = model.with_entry(key, bounds=(max(low, own.value / _SCATTER), min(high, own.value * _SCATTER)))
    return model


@dataclass(frozen=True)
class Parameters:
    """Parameters of a fit: ``values``, ``scales``, ``low`` and ``high`` bounds, each (P,), physical ones in SI.

    What is known beforehand: normal priors around ``mean`` with ``std`` (P,), infinite where nothing is. An angle that
    may go all the way round has a ``period`` (P,), all others an infinite one: it goes on at the other bound.
    ``turning`` (P,): by how much [rad/s] what goes on by itself turns with one more of a frequency `clocked`, else 0.
    """

    keys: tuple[str, ...]
    values: Array
    scales: Array
    low: Array
    high: Array
    mean: Array
    std: Array
    period: Array
    turning: Array

    @classmethod
    def of(cls, model: Model, keys: Iterable[str], priors: Priors = NO_PRIORS) -> Parameters:
        """Parameters of a model as they are, within the model's bounds."""
        keys = tuple(keys)
        low, high = np.array([model.entry(k).bounds for k in keys], dtype=float).reshape(-1, 2).T
        values = np.array([model.value(k) for k in keys], dtype=float)
        mean, std = np.array([priors.get(k, (0.0, np.inf)) for k in keys], dtype=float).reshape(-1, 2).T
        whole = [turns(model.parameter(k)) and h - w >= _TURN for k, w, h in zip(keys, low, high, strict=True)]
        scales = np.array([scale(model, k) for k in keys], dtype=float)
        turning = np.array([_TURN if clocked(model, k) else 0.0 for k in keys], dtype=float)
        return cls(keys, values, scales, low, high, mean, std, np.where(whole, _TURN, np.inf), turning)

    @classmethod
    def unbounded(cls, values: Array) -> Parameters:
        """Numbers that may be anything, of scale one."""
        infinite = np.full(values.size, np.inf)
        names = tuple(map(str, range(values.size)))
        return cls(names, values, np.ones(values.size), -infinite, infinite, values, infinite, infinite, 0.0 * values)

    def __len__(self) -> int:
        return len(self.keys)

    def __add__(self, other: Parameters) -> Parameters:
        pairs = zip(self._arrays, other._arrays, strict=True)
        return Parameters(self.keys + other.keys, *(np.concatenate(pair) for pair in pairs))

    def after(self, first: int) -> Parameters:
        """Without the ``first`` ones."""
        return Parameters(self.keys[first:], *(a[first:] for a in self._arrays))

    def chosen(self, places: Sequence[int]) -> Parameters:
        """Those at these places alone."""
        return Parameters(tuple(self.keys[i] for i in places), *(a[places] for a in self._arrays))

    def first(self, number: int) -> Parameters:
        """The first ones alone."""
        return Parameters(self.keys[:number], *(a[:number] for a in self._arrays))

    @property
    def _arrays(self) -> tuple[Array, ...]:
        return self.values, self.scales, self.low, self.high, self.mean, self.std, self.period, self.turning

    @property
    def prior_cost(self) -> float:
        """Sum of squared distances from what is known beforehand, over its standard deviations."""
        return float(np.sum(((self.values - self.mean) / self.std) ** 2))

    @property
    def prior_gradient(self) -> Array:
        """(P,) half the derivative of `prior_cost` by the values over their scales."""
        return (self.values - self.mean) / self.std**2 * self.scales

    @property
    def prior_information(self) -> Array:
        """(P,) half the second derivative."""
        return (self.scales / self.std) ** 2

    @property
    def by_key(self) -> dict[str, float]:
        """Key → value."""
        return dict(zip(self.keys, self.values.tolist(), strict=True))

    def moved(self, change: Array) -> Parameters:
        """Changed by so many scales (P,), within the bounds."""
        values = self.values + change * self.scales
        round_it = np.isfinite(self.period) & ((values < self.low) | (values > self.high))
        middle, turn = 0.5 * (self.low[round_it] + self.high[round_it]), self.period[round_it]
        values[round_it] -= turn * np.round((values[round_it] - middle) / turn)
        return replace(self, values=np.clip(values, self.low, self.high))

    @property
    def reach(self) -> tuple[Array, Array]:
        """How far (P,) each may go down and up, in its scale."""
        ends = np.where(np.isfinite(self.period), np.inf, 0.0)
        return (self.low - ends - self.values) / self.scales, (self.high + ends - self.values) / self.scales

    @property
    def at_bound(self) -> dict[str, str]:
        """Which are at a bound: key → "lowest" or "highest"."""
        down, up = self.reach
        found = {k: "highest" for k, u in zip(self.keys, up, strict=True) if u <= _AT_BOUND}
        return found | {k: "lowest" for k, d in zip(self.keys, down, strict=True) if -d <= _AT_BOUND}
