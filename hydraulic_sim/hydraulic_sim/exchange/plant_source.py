"""A model's plant as C: the text that numba compiles, translated, and a few functions around it."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import base, compose, kernels, slots
from ..effect import Effect
from ..errors import EffectError
from ..model import Model
from ..plant import Plant
from .translator import BUILTINS, Called, Function, Translator, arrays_of, number, tree_of

FRAME, HEADER = (Path(__file__).with_name(name) for name in ("plant.c", "plant.h"))
INITIAL = tuple(s.name for s in base.STATES if s.kind == "rate")
"""The states that a run of C can begin with."""
_WHOLE = frozenset({"hydraulic"})

SEE = """
def see(now, dt, command, on, P, hydraulic, S, M, Y):
    {constants1}
    {switches1}
    K = np.empty(NX); R = np.empty(NX - NR); G = np.empty(NX - NR)
    {rhs1}
    reading = position; reading_a = pressure_a; reading_b = pressure_b
    if any_position_sensor:
        {position_sensor}
    if any_pressure_sensor:
        {pressure_sensor}
    Y[0] = reading; Y[1] = velocity; Y[2] = reading_a; Y[3] = reading_b
    Y[4] = pressure_supply; Y[5] = spool; Y[6] = position
    Y[7] = pressure_a; Y[8] = pressure_b; Y[9] = opening
"""
"""What is seen at a sample without going on from it; the same slots as in the plant's loop."""


@dataclass(frozen=True)
class PlantSource:
    """A plant in C.

    ``files``: names and texts; ``parameters``: those of the model, key → place in the plant's array; ``n_parameters``:
    the length of that array; ``longest_step`` [s] of the integrator; ``initial``: what `INITIAL` begins with [SI];
    ``rate`` [Hz].
    """

    files: Mapping[str, str]
    parameters: Mapping[str, int]
    n_parameters: int
    longest_step: float
    initial: tuple[float, ...]
    rate: float


def plant_source(model: Model, rate: float) -> PlantSource:
    """The plant of a model, advanced by one sample of 1/``rate`` at a time.

    :raises EffectError: an effect that C cannot be written of; names its file and line.
    :raises SimulationError: the rate is too fast for the memory of an effect.
    """
    active = [e for e in model.library.values() if e.name in model.effects or e.always_on]
    scope, parts = _functions(active)  # first, as it compiles nothing
    plant = Plant(model)
    plant.simulate([0.0], 1.0 / rate)  # refuses a rate that a memory cannot follow
    layout = plant.layout
    names = {e.name for e in active}
    known = {f"on[{i}]": float(name in names) for name, i in layout.effects.items()}
    known |= {"hydraulic": float(model.kind == "hydraulic"), "seen": 0.0, "every": 0.0}  # nothing is seen of it
    scope |= {"NX": len(layout.states), "NR": layout.n_rates}
    module = compose.write_module(layout.library)
    for name, text in (("relax", module), ("run", module), ("see", _see(layout))):
        result = "long" if name == "run" else "double"
        tree = tree_of(text, name)
        # The memories are an array also where no effect has any.
        arrays = arrays_of(tree, scope) | {a.arg for a in tree.args.args if a.arg == "M"}
        returns = 0 if name == "see" else 1
        function = Function(f"plant_{name}", tree, scope, "the plant", known, arrays, _WHOLE, returns, result)
        parts.append(Translator(function).text())
        scope[name] = Called(f"plant_{name}", tuple(a.arg in arrays for a in tree.args.args), returns)
    keys = {key: layout.parameters[key] for key in model.keys()}  # noqa: SIM118, a method of the model
    rest = tuple(float(value) for value in plant.initial_state().states[: len(INITIAL)])
    values = _places(plant, parts, rest, rate)
    files = {f.name: filled(f.read_text(encoding="utf-8"), values) for f in (FRAME, HEADER)}
    return PlantSource(files, keys, len(layout.parameters), plant.longest_step, rest, rate)


def _see(layout: compose.Layout) -> str:
    return compose.fill(SEE, **compose.places(layout))


def _functions(active: list[Effect]) -> tuple[dict[str, Any], list[str]]:
    """What generated text calls, by the names that it uses, and the C of it."""
    import math

    import numpy

    scope: dict[str, Any] = {"math": math, "np": numpy}
    parts: list[str] = []
    shared: dict[int, Called] = {}
    for name in ("orifice_gain", "clamp", "beyond_whole"):
        scope[name] = _translated(getattr(kernels, name), f"kernel_{name}", 1, shared, parts, "kernels.py")
    for effect in active:
        for which, function in effect.functions().items():
            returns = len(slots.SLOTS[effect.slot].returns)
            if which == "dynamics":
                returns = sum(1 if s.kind == "rate" else 2 for s in effect.states)
            name = f"{effect.name}__{which}"
            scope[name] = _translated(function, f"effect_{name}", returns, shared, parts, f"effect {effect.name}")
    return scope, parts


def _plain(function: Any) -> Any:
    return getattr(function, "py_func", function)


def _translated(
    function: Any, name: str, returns: int | None, shared: dict[int, Called], parts: list[str], where: str
) -> Called:
    """A function and those that it calls, put among the ``parts``; ``returns`` None: as its text says."""
    plain = _plain(function)
    if id(plain) in shared:
        return shared[id(plain)]
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(plain))).body[0]
    except (OSError, SyntaxError) as error:
        raise EffectError(f"{where}: the source of {plain.__name__} cannot be read: {error}") from error
    if not isinstance(tree, ast.FunctionDef):
        raise EffectError(f"{where}: {plain.__name__} is no function with def; C cannot be written of it")
    tree.decorator_list = []
    scope: dict[str, Any] = {**plain.__globals__, **inspect.getclosurevars(plain).nonlocals}
    for called in _called(tree):
        other = scope.get(called)
        if callable(other):
            scope[called] = _translated(other, f"{name}_{called}", None, shared, parts, where)
    arrays, returns = arrays_of(tree, scope), _returns(tree) if returns is None else returns
    parts.append(Translator(Function(name, tree, scope, where, {}, arrays, frozenset(), returns)).text())
    found = Called(name, tuple(a.arg in arrays for a in tree.args.args), returns)
    shared[id(plain)] = found
    return found


def _called(tree: ast.FunctionDef) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id not in BUILTINS:
            yield node.func.id


def _returns(tree: ast.FunctionDef) -> int:
    for node in ast.walk(tree):
        if isinstance(node, ast.Return) and isinstance(node.value, ast.Tuple):
            return len(node.value.elts)
    return 1


def _places(plant: Plant, parts: list[str], rest: tuple[float, ...], rate: float) -> dict[str, str]:
    """Sizes, values and functions for their places in the frames."""
    layout = plant.layout
    start = []
    for key, record in layout.state_records.items():
        place, value = layout.states[key], record.initial
        if value == "command":
            text = "command"
        else:
            text = f"plant->p[{layout.parameters[value]}]" if isinstance(value, str) else number(float(value))
        start.append(f"    plant->x[{place}] = {text};")
    return {
        "N_PARAMETERS": str(len(layout.parameters)),
        "N_STATES": str(len(layout.states)),
        "N_MEMORY": str(max(layout.n_memory, 1)),
        "N_OUTPUTS": str(len(base.OUTPUTS)),
        "OUTPUTS": ", ".join(base.OUTPUTS),
        "SAMPLE": number(1.0 / rate),
        "LONGEST_STEP": number(plant.longest_step),
        "TURN": number(plant.embedded().turn),
        "DRIVE_LIMIT": str(layout.parameters["drive_limit"]),
        "DEFAULTS": ", ".join(number(plant.value(key)) for key in layout.parameters),
        "INITIAL": ", ".join(map(number, rest)),
        "START": "\n".join(start),
        "FUNCTIONS": "\n".join(parts),
    }


def filled(frame: str, values: Mapping[str, str]) -> str:
    """A frame of C with texts in the places ``@NAME@``."""
    for name, text in values.items():
        frame = frame.replace(f"@{name}@", text)
    return frame
