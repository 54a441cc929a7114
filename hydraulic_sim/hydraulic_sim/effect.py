"""What a physical effect is: one record that everything else derives from.

An effect file (in `effects/`, or a user's own) defines one module constant ``EFFECT``. Its name is the file's
name. ROS parameters, bounds of a fit, tables of a report and the documentation all read this record; there is
no second list of effects anywhere.

A kernel is an ordinary function of scalars; numba compiles it. Its *argument names* say what it wants:

- a parameter or a state of the effect itself, by its name;
- a signal of the plant (`slots.SIGNALS`), such as ``velocity`` or ``pressure_difference``;
- a base parameter (`base.PARAMETERS`), such as ``moving_mass``;
- a parameter of another effect, declared in ``uses`` as ``{"argument": "effect.parameter"}`` (zero while that
  effect is off);
- in the per-sample slots, ``memory`` (the effect's own array) and ``dt`` [s], for how long what it returns holds;
- of an effect on the command, the sampling ``interval`` [s] and how far ``into`` it the sample is [s]: 0, or where an
  effect with a ``shift`` has the command change within a sample.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from .errors import EffectError


@dataclass(frozen=True)
class Parameter:
    """One physical constant: its SI unit, default, allowed range and where the numbers come from.

    ``null`` is the value at which the effect contributes exactly nothing; ``None`` marks a shape parameter, which
    has no such value of its own. ``free`` says whether a fit may move it unless a model file says otherwise.
    ``required`` marks a base parameter for which no default is sensible: a model file must give it. ``nuisance``
    marks one that only smooths a law where it has a corner: no data sheet states it, a diagnosis fits it too.
    ``observed`` names what of a record shows the value by itself: "resolution", the step between position readings,
    "blur", how much noise there is before they are rounded to it.
    """

    name: str
    unit: str
    default: float
    bounds: tuple[float, float]
    description: str
    source: str
    null: float | None = None
    free: bool = True
    required: bool = False
    nuisance: bool = False
    observed: str | None = None

    def __post_init__(self) -> None:
        low, high = self.bounds
        if not low < high:
            raise EffectError(f"parameter {self.name}: bounds {self.bounds} are not in rising order")
        for label, value in (("default", self.default), ("null", self.null)):
            if value is not None and not low <= value <= high:
                raise EffectError(f"parameter {self.name}: {label} {value} lies outside {low}…{high} {self.unit}")
        if not self.name.isidentifier():
            raise EffectError(f"parameter name {self.name!r} is not a Python identifier")
        if not self.source:
            raise EffectError(f"parameter {self.name} names no source")


@dataclass(frozen=True)
class State:
    """A state an effect adds to the plant.

    ``kind`` "rate": the dynamics kernel returns its time derivative. ``kind`` "relaxation": the kernel returns
    (rate [1/s], target); the state obeys ds/dt = rate·(target − s) and is integrated without a stability limit.
    ``initial`` names the base parameter it starts from, or is a number.
    """

    name: str
    unit: str
    initial: float | str = 0.0
    kind: str = "rate"
    scale: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in ("rate", "relaxation"):
            raise EffectError(f"state {self.name}: kind {self.kind!r} is neither 'rate' nor 'relaxation'")


@dataclass(frozen=True)
class Effect:
    """A physical effect. Units are SI. See the module's docstring for the kernels' arguments.

    ``slot`` is a key of `slots.SLOTS` and fixes what the kernel returns; ``dynamics`` returns one entry per state
    (for a relaxation state two: its rate and its target). ``memory`` is the number of values kept between samples.
    ``order`` sorts effects within a slot. ``step_rate`` estimates the fastest rate [1/s] that the effect brings, from
    parameters alone, so that the integrator's step can follow it; ``reach`` says how far back [s] its memory must go
    (one value per sample; without it the memory may keep what is long past); ``shift`` names the parameter [s] by which
    it moves the command, and by whose part of a sampling interval what it returns changes within one.
    ``begins_shown``: the memory of a position sensor may begin as if all had always moved like now (memory[0] is 0), or
    with what the sensor showed (memory[0] is −1, memory[1] that [m], memory[2] its noise over the usual acceleration
    [s²]). ``always_on`` marks base physics.
    ``wear`` says what of a machine ages where the effect grows; empty where nothing does.
    ``alike_without_pressures`` names the family whose members drive and position alone cannot distinguish. ``kinds``:
    of plants in which it can act. ``searched``: whether a diagnosis may find it missing; how a machine is built
    (a controller inside, a load that was put on) is for the model file to say.
    """

    slot: str
    summary: str
    kernel: Callable
    parameters: tuple[Parameter, ...]
    equation: str
    source: str
    excited_by: str
    confused_with: tuple[str, ...]
    distinguished_by: str
    states: tuple[State, ...] = ()
    dynamics: Callable | None = None
    memory: int = 0
    uses: Mapping[str, str] = field(default_factory=dict)
    alike_without_pressures: str = ""
    order: int = 0
    step_rate: Callable | None = None
    reach: Callable | None = None
    shift: str = ""
    begins_shown: bool = False
    always_on: bool = False
    wear: str = ""
    kinds: tuple[str, ...] = ("hydraulic", "mechanical")
    searched: bool = True
    name: str = ""

    def __post_init__(self) -> None:
        names = [p.name for p in self.parameters] + [s.name for s in self.states]
        doubled = sorted({n for n in names if names.count(n) > 1})
        if doubled:
            raise EffectError(f"effect {self.name or '?'}: the names {doubled} appear twice")
        if bool(self.states) != (self.dynamics is not None):
            raise EffectError(f"effect {self.name or '?'}: states and a dynamics kernel go together")
        if not self.always_on and all(p.null is None for p in self.parameters):
            raise EffectError(f"effect {self.name or '?'}: no parameter has a null value")
        if self.begins_shown and (self.slot != "position_sensor" or self.memory < 3):
            raise EffectError(
                f"effect {self.name or '?'}: begins_shown in slot {self.slot!r} with memory {self.memory}: it is for a "
                "position_sensor with a memory of 3 or more"
            )
        for text in ("summary", "equation", "source", "excited_by", "distinguished_by"):
            if not getattr(self, text).strip():
                raise EffectError(f"effect {self.name or '?'}: {text} is empty")

    def functions(self) -> dict[str, Callable]:
        """The functions that are compiled: ``kernel`` and, with states, ``dynamics``."""
        found = {"kernel": self.kernel}
        if self.dynamics is not None:
            found["dynamics"] = self.dynamics
        return found


@lru_cache(maxsize=1024)
def arguments(function: Callable) -> tuple[str, ...]:
    """The argument names of a kernel, in order."""
    return tuple(inspect.signature(function).parameters)


def check_value(parameter: Parameter, value: float, where: str) -> float:
    """Return ``value`` as float; raise `EffectError` when it is not finite or outside the parameter's bounds."""
    low, high = parameter.bounds
    number = float(value)
    if not math.isfinite(number) or not low <= number <= high:
        raise EffectError(f"{where}: {number:g} {parameter.unit} is outside {low:g} … {high:g} {parameter.unit}")
    return number
