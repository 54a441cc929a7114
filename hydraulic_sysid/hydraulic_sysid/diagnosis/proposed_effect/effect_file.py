"""The text of an effect file: a law over a variable at a place of the plant, in the form of the library's own files."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from types import CodeType
from typing import Any

import numpy as np

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import Effect
from hydraulic_sysid.data.display import UNITS
from hydraulic_sysid.diagnosis.search.nonparametric_curves import Place

from .laws import FittedLaw

EXPRESSIONS = {
    "time": "t",
    "speed": "abs(velocity)",
    "size_of_opening": "abs(opening)",
    "mean_pressure": "0.5 * (pressure_a + pressure_b)",
    "size_of_pressure_difference": "abs(pressure_difference)",
}
"""Variable → what a kernel has of it, where that goes by another name."""
_DIGITS = 5
_REACH = 10.0  # times its value that a coefficient may be
_SHAPE_REACH = {"period": 1.1}  # times the value that a shape parameter may be, and its inverse
_WIDEST = 5.0
_LATEST = 20.0  # times the lag of a law that remembers, and its inverse
_MARGIN = 3.0  # on the steepness that the integrator's step follows: a fit may move the law
_MOST_NAMES = 6
_WIDTH = 116


def effect_text(
    at: Place, fitted: FittedLaw, extent: tuple[float, float], evidence: str, records: Sequence[str]
) -> str:
    """The file.

    :param at: the place of the law, and its variable
    :param fitted: coefficients in the unit of the hat function's height
    :param extent: least and largest value of the variable in the records
    :param evidence: sentences for the docstring
    """
    effect, variable = at.effect, at.variable
    place: Mapping[str, Any] = effect.kernel.__globals__
    returns = place["RETURNS"] if isinstance(place["RETURNS"], str) else place["RETURNS"][variable]
    z = place.get("EXPRESSIONS", {}).get(variable) or EXPRESSIONS.get(variable, variable)
    words = variable.replace("_", " ")
    law, unit, own = fitted.law, effect.parameters[0].unit, UNITS.get(variable, "1")
    signals = _names(z) | _names(returns) - {"law"}
    arguments = [*sorted(signals), *law.coefficients, *law.shapes]
    source = f"proposed by diagnose from {named(records)}"
    summary = f"{effect.summary.removesuffix(' of any shape')} that depends on the {words}"
    equation = effect.equation.replace("height*hat(z)", "f(z)") + f"; f(z) = {law.equation}; z: {words}"
    imports, rate = _step_rate(effect, signals, fitted, extent)
    dynamics, states = _memory(effect)
    constants = []
    if fitted.knots is not None:
        first, step = float(fitted.knots[0]), float(fitted.knots[1] - fitted.knots[0])
        constants = [f"FIRST, STEP = {first:.6g}, {step:.6g}  # of the knots, {_unit(own)}"]
    body = [f"z = {z}", *law.lines, f"return {returns}"]
    needs_math = any("math." in line for line in (*body, rate))
    lines = [
        f'"""{summary[:1].upper()}{summary[1:]} (proposed by diagnose).',
        "",
        f"    {equation}" if len(equation) < _WIDTH - 4 else textwrap.fill(equation, _WIDTH, initial_indent="    ",
                                                                          subsequent_indent="        "),
        "",
        textwrap.fill(evidence, _WIDTH),
        "",
        textwrap.fill(f"Source: {source}.", _WIDTH),
        '"""',
        "",
        *(["import math", ""] if needs_math else []),
        *imports,
        f"from hydraulic_sim.effect import Effect, Parameter{', State' if effect.states else ''}",
        "",
        *constants,
        *_text_argument("SOURCE", source, " = ", ""),
        "",
        "",
        *dynamics,
        *_signature(arguments),
        *(f"    {line}" for text in body for line in _broken(text)),
        "",
        "",
        "EFFECT = Effect(",
        f"    slot={_quoted(effect.slot)},",
        *(f"    {line}" for line in _text_argument("summary", summary)),
        "    kernel=add,",
        "    parameters=(",
        *(f"        {line}" for p in _parameters(at, fitted, unit, own, extent) for line in _two_lines(p)),
        "    ),",
        *(f"    {line}" for line in states),
        *(f"    {line}" for line in _text_argument("equation", equation)),
        "    source=SOURCE,",
        f"    excited_by={_quoted(f'motion over the whole range of the {words}')},",
        "    confused_with=(),",
        f"    distinguished_by={_quoted(f'the curve over the {words}')},",
        f"    order={effect.order},",
        *([f"    step_rate=lambda p: {rate},"] if rate else []),
        ")",
        "",
    ]  # fmt: skip
    return "\n".join(lines)


def named(records: Sequence[str]) -> str:
    """The records in a text that may stand in a file of Python: nothing but plain characters, and not too many."""
    shown = [re.sub(r"[^\w .,()+-]", "_", name) for name in records[:_MOST_NAMES]]
    more = len(records) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def per(unit: str, other: str, power: int) -> str:
    """A unit over another to some power: ``N``, ``m/s``, 2 → ``N*s^2/m^2``."""
    powers = Counter(_powers(unit))
    for symbol, exponent in _powers(other).items():
        powers[symbol] -= power * exponent
    above, below = (
        [s if abs(n) == 1 else f"{s}^{abs(n)}" for s, n in powers.items() if n * sign > 0] for sign in (1, -1)
    )
    text = "*".join(above) or "1"
    if below:
        text += f"/{below[0]}" if len(below) == 1 else f"/({'*'.join(below)})"
    return text


def _powers(unit: str) -> dict[str, int]:
    found: Counter[str] = Counter()
    above, _, below = unit.partition("/")
    for text, sign in ((above, 1), (below, -1)):
        for part in text.strip("()").split("*"):
            symbol, _, power = part.partition("^")
            if symbol not in ("", "1"):
                found[symbol] += sign * int(power or 1)
    return found


def _names(expression: str) -> set[str]:
    """Signals and base parameters in an expression."""
    code: CodeType = compile(expression, "<law>", "eval")
    tree = ast.parse(expression, mode="eval")
    assert code.co_names
    return {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)} - {"abs", "math", "max", "min"}


def _memory(effect: Effect) -> tuple[list[str], list[str]]:
    """Lines of what a law remembers: its dynamics, and what the effect says of it; none for one that does not."""
    if not effect.states or effect.dynamics is None:
        return [], []
    states = ", ".join(
        f"State({_quoted(s.name)}, {_quoted(s.unit)}, kind={_quoted(s.kind)}, scale={s.scale!r})"
        for s in effect.states
    )
    source = inspect.getsource(effect.dynamics).splitlines()
    return [*source, "", ""], [f"dynamics={effect.dynamics.__name__},", f"states=({states},),"]


def _parameters(place: Place, fitted: FittedLaw, unit: str, own: str, extent: tuple[float, float]) -> list[str]:
    law, found, words = fitted.law, list[str](), place.variable.replace("_", " ")
    sizes: dict[int, float] = {}
    for power, value in zip(law.powers, fitted.coefficients.tolist(), strict=True):
        sizes[power] = max(sizes.get(power, 0.0), abs(value))
    for i, (name, value, power) in enumerate(
        zip(law.coefficients, fitted.coefficients.tolist(), law.powers, strict=True)
    ):
        most = _rounded(_REACH * sizes[power], 1)
        least = -most
        if fitted.knots is not None and place.height.bounds[0] == 0.0:
            least, value = 0.0, max(value, 0.0)
        at = f"law at {words} {fitted.knots[i]:.4g} {own}" if fitted.knots is not None else f"{name} of the law"
        found.append(_parameter(name, per(unit, own, power), value, (least, most), at, "null=0.0"))
    low, high = extent
    for name, value in zip(law.shapes, fitted.shape, strict=True):
        if name in ("corner", "centre"):
            bounds = (_rounded(min(low, value), 3), _rounded(max(high, value), 3))
            bounds = (min(bounds[0], value), max(bounds[1], value))
        else:
            reach = _SHAPE_REACH.get(name, _WIDEST)
            bounds = (value / reach, value * reach)
        found.append(_parameter(name, own, value, bounds, f"{name} of the law, {words}"))
    for p in place.effect.parameters:
        if p.name in place.shape:
            value = place.shape[p.name]
            found.append(_parameter(p.name, p.unit, value, (value / _LATEST, value * _LATEST), p.description))
    return found


def _parameter(name: str, unit: str, value: float, bounds: tuple[float, float], what: str, more: str = "") -> str:
    value = _rounded(value)
    low, high = min(_rounded(bounds[0], 3), value), max(_rounded(bounds[1], 3), value)
    rest = f", {more}" if more else ""
    return f"Parameter({_quoted(name)}, {_quoted(unit)}, {value!r}, ({low!r}, {high!r}), {_quoted(what)}, SOURCE{rest})"


def _two_lines(parameter: str) -> list[str]:
    """A parameter, its description on a line of its own where it is too long for one."""
    if len(parameter) <= _WIDTH - 8:
        return [f"{parameter},"]
    numbers, _, what = parameter.partition("), ")
    return [f"{numbers}),", f"{' ' * len('Parameter(')}{what},"]


def _step_rate(
    effect: Effect, signals: set[str], fitted: FittedLaw, extent: tuple[float, float]
) -> tuple[list[str], str]:
    """Imports and text of the fastest rate that a force brings; empty where nothing is faster than the oil."""
    if effect.slot != "force":
        return [], ""
    z: Array = np.linspace(*extent, 400, dtype=np.float64)
    values = fitted.values(z)
    if "direction" in signals:
        level = _rounded(_MARGIN * float(np.abs(values).max()), 2)
        return ["from hydraulic_sim.base import dry_friction_rate"], f"dry_friction_rate({level!r}, p)"
    steepest = _rounded(_MARGIN * float(np.abs(np.gradient(values, z)).max()), 2)
    if effect.states:  # the lag and the force, one after the other
        return [], f'math.sqrt({steepest!r} / (p["moving_mass"] * p["lag"]))'
    if "position" in signals:
        return [], f'math.sqrt({steepest!r} / p["moving_mass"])'
    return ([], f'{steepest!r} / p["moving_mass"]') if "velocity" in signals else ([], "")


def _rounded(value: float, digits: int = _DIGITS) -> float:
    return float(f"{value:.{digits - 1}e}")


def _unit(unit: str) -> str:
    return "of all" if unit == "1" else f"[{unit}]"


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "_").replace('"', "'").replace("\n", " ") + '"'


def _text_argument(name: str, text: str, sign: str = "=", end: str = ",") -> list[str]:
    """A text that is given a name, in brackets on several lines where it is too long for one."""
    whole = f"{name}{sign}{_quoted(text)}{end}"
    if len(whole) <= _WIDTH - 4:
        return [whole]
    parts = textwrap.wrap(text, _WIDTH - 16, drop_whitespace=False)
    return [f"{name}{sign}(", *(f"    {_quoted(part)}" for part in parts), f"){end}"]


def _signature(arguments: Sequence[str]) -> list[str]:
    whole = f"def add({', '.join(arguments)}):"
    if len(whole) <= _WIDTH:
        return [whole]
    return [
        "def add(",
        textwrap.fill(", ".join(arguments) + ",", _WIDTH, initial_indent="    ", subsequent_indent="    "),
        "):",
    ]


def _broken(line: str) -> list[str]:
    """A statement on several lines where it is too long for one; only what is in brackets may be broken."""
    if len(line) <= _WIDTH - 4:
        return [line]
    name, _, value = line.partition(" = ")
    inner = value[1:-1] if value.startswith("(") else value
    return [f"{name} = (", *textwrap.wrap(inner, _WIDTH - 8, initial_indent="    ", subsequent_indent="    "), ")"]
