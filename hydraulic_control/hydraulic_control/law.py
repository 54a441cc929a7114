"""What a control law is: one file of this folder with a constant LAW.

A law's three functions work on records: ``p`` of parameters (the shared ones, its own without the prefix of its name,
and what `Law.design` makes of them), ``s`` of what it remembers (the shared part, and its own).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hydraulic_node_utils.parameter_spec import ParameterSpec

Values = Mapping[str, Any]
Field = tuple[str, tuple[int, ...]]
"""Name and shape of numbers in a record; () is a single one."""


class SimpleModel(NamedTuple):
    """K/(s(Ts + 1)) from the drive [V] to the position [m]: velocity gain K [m/(s·V)] and lag T [s].

    Beyond it the resonance of oil and load: its frequency [rad/s] and damping ratio.
    """

    velocity_gain: float
    lag: float
    frequency: float = 245.0
    damping: float = 0.1


def begin_nothing(p: Any, s: Any, position: float) -> None:
    """Nothing of its own to begin: all that a law remembers is 0 already."""


def end_nothing(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Nothing of its own to advance."""


def same(values: Values) -> dict[str, Any]:
    """No design."""
    return {}


MODEL = "model"
"""What a claim names that compares a law's worst plant with the model, not with another law."""


@dataclass(frozen=True)
class Claim:
    """What a publication says of its law, as a ratio that can be measured; a value where nothing divides it.

    :param text: the claim, and whose it is
    :param trial: what the law is tried on (`trials.TRIALS`), ``figure`` what is read there (`response`)
    :param over: the law that it is compared with, on the same trial; `MODEL`: its worst plant with the model
    :param over_trial: the trial that it is compared with, of the same law
    :param low: the claim holds from here …
    :param high: … to here
    """

    text: str
    trial: str
    figure: str
    over: str = ""
    over_trial: str = ""
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class Law:
    """A law of control.

    :param description: one line
    :param source: where it is published
    :param begin: ``begin(p, s, position)``: start at rest at a position [m]; the record is zero before
    :param drive: ``drive(p, s, dt, reference, reference_velocity, position)``: drive [V] that is wanted
    :param end: ``end(p, s, dt, e, wanted)``, once ``s.drive`` is what may be had of it: integrals, observers
    :param parameters: its own, with their full names, ``law.parameter`` where no other law is to share them
    :param state: what it remembers
    :param derived: fields of the record that ``design`` fills
    :param design: derived fields from the parameters by name
    :param tuned: parameters that `tune` optimises
    :param starts: where the search begins, of a simple model and PID gains by rule
    :param follows: the law whose optimum is a start as well, and its values as this one's
    :param needs: what it is made from beyond its parameters, for the user
    :param claims: what is published of it
    """

    description: str
    source: str
    drive: Callable[..., float]
    parameters: tuple[ParameterSpec, ...]
    tuned: tuple[str, ...]
    starts: Callable[[SimpleModel, list[Values]], list[dict[str, Any]]]
    begin: Callable[..., None] = begin_nothing
    end: Callable[..., None] = end_nothing
    state: tuple[Field, ...] = ()
    derived: tuple[Field, ...] = ()
    design: Callable[[Values], Mapping[str, Any]] = same
    follows: tuple[str, Callable[[Values], list[dict[str, Any]]]] | None = None
    needs: str = ""
    claims: tuple[Claim, ...] = ()
    name: str = ""

    def field(self, parameter: str) -> str:
        """Name of a parameter in the record."""
        return parameter.removeprefix(f"{self.name}.").replace(".", "_")


def number(name: str, default: float, text: str, unit: str, low: float, high: float) -> ParameterSpec:
    """A parameter that can be set while the loop runs."""
    return ParameterSpec(name, default, text, unit, low, high, live=True)


def choice(name: str, default: str, choices: tuple[str, ...], text: str) -> ParameterSpec:
    """A parameter with named values; the record holds the place in the list."""
    return ParameterSpec(name, default, text, live=True, choices=choices)


def model_parameters(law: str) -> tuple[ParameterSpec, ParameterSpec]:
    """Velocity gain and lag of the model K/(s(Ts + 1)) that a law contains."""
    return (
        number(f"{law}.velocity_gain", 0.0434, "K of the model K/(s(Ts + 1))", "m/(s*V)", 1e-6, 10.0),
        number(f"{law}.lag", 5e-3, "T of the model", "s", 1e-4, 10.0),
    )


def model_values(law: str, simple: SimpleModel) -> dict[str, float]:
    """The values of `model_parameters`."""
    return {f"{law}.velocity_gain": simple.velocity_gain, f"{law}.lag": simple.lag}


def record(fields: tuple[Field, ...]) -> np.dtype:
    """The type of a record with these fields."""
    return np.dtype([(name, np.float64, shape) if shape else (name, np.float64) for name, shape in fields])


def fed_forward(simple: SimpleModel, starts: Iterable[Values]) -> list[dict[str, Any]]:
    """The starts, with the velocity of the reference fed forward."""
    return [{"velocity_feedforward": 1.0 / simple.velocity_gain, **one} for one in starts]
