"""The mode "guess what is wrong": the simulator hides an effect, and the user finds it with the tools."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from hydraulic_node_utils.yaml_text import load_yaml
from hydraulic_sim.model import Model
from hydraulic_workbench.errors import NotNowError, WorkbenchError
from hydraulic_workbench.reading.models import display

FILE = Path(__file__).with_name("guesses.yaml")
HIDDEN, GUESSED, REVEALED = "hidden", "guessed", "revealed"


@dataclass
class Guess:
    """One riddle: the effect that is hidden, its values [SI] and units, and how the guessing stands."""

    effect: str
    values: Mapping[str, float]
    units: Mapping[str, str]
    phase: str = HIDDEN
    tries: int = 0
    text: str = "The simulator hides one effect. Record an experiment, and find out which."

    def answer(self, effect: Any) -> dict[str, Any]:
        """Whether a name is right.

        :raises NotNowError: the answer is known already.
        """
        if self.phase != HIDDEN:
            raise NotNowError("the answer is known already: start another riddle")
        if not isinstance(effect, str) or not effect:
            raise WorkbenchError("name an effect of the library", "effect")
        self.tries += 1
        right = effect == self.effect
        if right:
            self.phase = GUESSED
            self.text = f"Right, with {self.tries} {'try' if self.tries == 1 else 'tries'}: {self._named()}."
        else:
            self.text = f"It is not {effect.replace('_', ' ')}."
        return self._said(right)

    def reveal(self) -> dict[str, Any]:
        """Tell the answer."""
        if self.phase == HIDDEN:
            self.phase, self.text = REVEALED, f"It was {self._named()}."
        return self._said(self.phase == GUESSED)

    def document(self) -> dict[str, Any]:
        """For the page; the effect only once it is known."""
        known = self.phase != HIDDEN
        return {"phase": self.phase, "tries": self.tries, "right": self.phase == GUESSED, "text": self.text,
                "effect": self.effect if known else None}  # fmt: skip

    def _said(self, right: bool) -> dict[str, Any]:
        known = self.phase != HIDDEN
        rows = [
            {"name": name, "value": value, "unit": self.units[name], "display": display(self.units[name])}
            for name, value in self.values.items()
        ]
        return {"right": right, "text": self.text} | ({"effect": self.effect, "parameters": rows} if known else {})

    def _named(self) -> str:
        parts = []
        for name, value in self.values.items():
            shown = display(self.units[name])
            parts.append(f"{name.replace('_', ' ')} {value * shown['factor']:.3g} {shown['unit']}")
        return f"{self.effect.replace('_', ' ')} ({', '.join(parts)})"


def candidates() -> dict[str, dict[str, Sequence[float]]]:
    """Effects that may be hidden, with the ranges of their parameters."""
    found = load_yaml(YAML(typ="safe"), FILE.read_text("utf-8"))
    return {str(name): dict(ranges) for name, ranges in found.items()}


def draw(model: Model, effect: str = "", seed: int | None = None) -> Guess:
    """A riddle over a model: the effect, or one drawn, with values drawn from their ranges.

    :raises WorkbenchError: the model has the effect already, or there is no such effect.
    """
    generator: random.Random = random.SystemRandom() if seed is None else random.Random(seed)
    ranges = {name: row for name, row in candidates().items() if name not in model.effects}
    name = effect or generator.choice(sorted(ranges))
    if name in model.effects or name not in model.library:
        raise WorkbenchError(f"{name!r} cannot be hidden in {model.name}: it has it, or the library has not", "effect")
    values, units = {}, {}
    for parameter in model.library[name].parameters:
        low, high = ranges.get(name, {}).get(parameter.name, (parameter.default, parameter.default))
        values[parameter.name] = float(f"{generator.uniform(low, high):.4g}")
        units[parameter.name] = parameter.unit
    return Guess(name, values, units)
