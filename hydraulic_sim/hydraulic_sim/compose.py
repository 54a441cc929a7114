"""Effects become one flat right-hand side: the text of a module that numba compiles.

Every effect of a library is in the text, behind a switch, so that turning one on or off compiles nothing. The
plant's equations stand in `equations.RHS` once; they are written into the loop of the Runge-Kutta step (so that
nothing is called there that the compiler does not see through) and into a bare right-hand side for other solvers.

Layout of the arrays that the generated functions take:

- P (n_parameters,): base parameters, then each effect's (`Layout.parameters`);
- on (n_effects,): 1 where the effect is on; X (n_states,): rate states first, then relaxation states;
- M (n_memory,): the effects' memories.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from . import base, slots
from .effect import Effect, State, arguments
from .equations import MODULE, RHS
from .registry import Library

REVERSAL_BEND = 0.02  # sliding within one step, of the bristle length, from which a reversal is refined
REVERSAL_STEP = 0.125  # and by how much
MOST_SUBSTEPS = 2000  # in one sample, or per millisecond of it; beyond, the physics is called too stiff


@dataclass(frozen=True)
class Layout:
    """Where each parameter, state and memory of a library lies in the plant's arrays."""

    library: Library

    @cached_property
    def effects(self) -> dict[str, int]:
        """Effect → its switch."""
        return {name: i for i, name in enumerate(self.library)}

    @cached_property
    def parameters(self) -> dict[str, int]:
        """Key of a parameter → its place in P."""
        keys = [p.name for p in base.PARAMETERS]
        keys += [f"{e.name}.{p.name}" for e in self.library.values() for p in e.parameters]
        return {key: i for i, key in enumerate(keys)}

    @cached_property
    def state_records(self) -> dict[str, State]:
        """Key of a state → its record, rate states first."""
        every = {s.name: s for s in base.STATES}
        every |= {f"{e.name}.{s.name}": s for e in self.library.values() for s in e.states}
        by_kind = sorted(every.items(), key=lambda item: item[1].kind == "relaxation")
        return dict(by_kind)

    @cached_property
    def states(self) -> dict[str, int]:
        """Key of a state → its place in X."""
        return {key: i for i, key in enumerate(self.state_records)}

    @cached_property
    def state_names(self) -> tuple[str, ...]:
        """Keys of the states, in the order of X."""
        return tuple(self.states)

    @cached_property
    def n_rates(self) -> int:
        """How many of the states are rate states."""
        return sum(s.kind == "rate" for s in self.state_records.values())

    @cached_property
    def memories(self) -> dict[str, slice]:
        """Effect → its part of M."""
        found, start = {}, 0
        for effect in self.library.values():
            if effect.memory:
                found[effect.name] = slice(start, start + effect.memory)
                start += effect.memory
        return found

    @cached_property
    def n_memory(self) -> int:
        """Length of M."""
        return max((s.stop for s in self.memories.values()), default=0)

    @cached_property
    def places(self) -> tuple[str, ...]:
        """What lies in X and M, in order: libraries of which this is the same have the same arrays."""
        return (*self.states, *(f"{name}[{part.stop - part.start}]" for name, part in self.memories.items()))


class Writer:
    """Writes the calls of one library's effects."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout

    def members(self, slot: str) -> list[Effect]:
        """Effects that act in a slot."""
        return [e for e in self.layout.library.values() if e.slot == slot]

    def parameter(self, key: str) -> str:
        """Text of a parameter's value."""
        return f"P[{self.layout.parameters[key]}]"

    def call(self, effect: Effect, which: str = "kernel") -> str:
        """Text of the call of an effect's function."""
        return (
            f"{effect.name}__{which}({', '.join(self._value(effect, a) for a in arguments(effect.functions()[which]))})"
        )

    def _value(self, effect: Effect, argument: str) -> str:
        if argument in (p.name for p in effect.parameters):
            return self.parameter(f"{effect.name}.{argument}")
        if argument in (s.name for s in effect.states):
            return f"S[{self.layout.states[f'{effect.name}.{argument}']}]"
        if argument in effect.uses:
            key = effect.uses[argument]
            owner = key.rpartition(".")[0]
            value = self.parameter(key)
            return f"({value} if on[{self.layout.effects[owner]}] else 0.0)" if owner else value
        if argument == "memory":
            place = self.layout.memories[effect.name]
            return f"M[{place.start}:{place.stop}]"
        if argument in {p.name for p in base.PARAMETERS}:
            return self.parameter(argument)
        if effect.slot == "command" and argument in ("dt", "interval"):
            return {"dt": "held", "interval": "dt"}[argument]
        if argument == "command" and not slots.SLOTS[effect.slot].per_sample and effect.slot != "loop":
            return "demand"
        return argument

    def slot(self, name: str) -> str:
        """The statements of one stage: nothing where the library has no effect for it."""
        stage, lines = slots.SLOTS[name], []
        left = ", ".join(stage.returns)
        for effect in self.members(name):
            lines.append(f"    if on[{self.layout.effects[effect.name]}]:")
            if stage.kind == "sum" and len(stage.returns) > 1:
                parts = [f"part_{i}" for i in range(len(stage.returns))]
                lines.append(f"        {', '.join(parts)} = {self.call(effect)}")
                lines += [f"        {r} += {p}" for r, p in zip(stage.returns, parts, strict=True)]
            else:
                sign = "+=" if stage.kind == "sum" else "="
                lines.append(f"        {left} {sign} {self.call(effect)}")
        return "\n".join([f"if any_{name}:", *lines]) if lines else "pass"

    def dynamics(self) -> str:
        """The derivatives of the states that effects add."""
        lines = []
        n_rates = self.layout.n_rates
        for effect in self.layout.library.values():
            if not effect.states:
                continue
            names, lefts = [], []
            for state in effect.states:
                index = self.layout.states[f"{effect.name}.{state.name}"]
                if state.kind == "rate":
                    lefts.append(f"K[{index}]")
                else:
                    lefts += [f"R[{index - n_rates}]", f"G[{index - n_rates}]"]
                names.append(state.name)
            lines += [
                f"    if on[{self.layout.effects[effect.name]}]:",
                f"        {', '.join(lefts)} = {self.call(effect, 'dynamics')}",
            ]
        return "\n".join(["if any_dynamics:", *lines]) if lines else "pass"

    def cut(self) -> str:
        """Where in a sample the command changes, and how many parts it has."""
        lines = ["cut = 0.0"]
        for effect in self.members("command"):
            if effect.shift:
                key = f"{effect.name}.{effect.shift}"
                lines += [
                    f"if on[{self.layout.effects[effect.name]}]:",
                    f"    cut = beyond_whole({self.parameter(key)}, dt)",
                ]
        return "\n".join([*lines, "parts = 2 if cut > 0.0 else 1"])

    def switch(self, slot: str) -> str:
        """The flag of a stage."""
        return f"any_{slot} = {self._any_on(self.members(slot))}"

    def switches(self) -> str:
        """One flag per stage, so that a stage without effects costs one test."""
        lines = [self.switch(name) for name in slots.SLOTS]
        lines.append(f"any_dynamics = {self._any_on(e for e in self.layout.library.values() if e.states)}")
        dry = [
            f"(on[{self.layout.effects[e.name]}] != 0 and ({self._acts(e)}))"
            for e in self.layout.library.values()
            if any("direction" in arguments(f) for f in e.functions().values())
        ]
        lines.append("any_direction = " + (" or ".join(dry) or "False"))
        return "\n".join(lines)

    def moving(self) -> str:
        """How many rate states and relaxation states change: without effects that have any, those of the base."""
        lines = []
        for kind, name, every in (("rate", "rates_on", "NR"), ("relaxation", "relaxations_on", "NX - NR")):
            own = sum(s.kind == kind for s in base.STATES)
            having = [e for e in self.layout.library.values() if any(s.kind == kind for s in e.states)]
            lines.append(f"{name} = {every} if {self._any_on(having)} else {own}")
        return "\n".join(lines)

    def _any_on(self, effects: Iterable[Effect]) -> str:
        """The test that any of them is on: a sum, as a branch for each would take long to compile."""
        switches = " + ".join(f"on[{self.layout.effects[e.name]}]" for e in effects)
        return f"{switches} != 0" if switches else "False"

    def _acts(self, effect: Effect) -> str:
        """The test that an effect is not at its null value."""
        keyed = ((self.parameter(f"{effect.name}.{p.name}"), p.null) for p in effect.parameters)
        return " or ".join(f"{value} != {null!r}" for value, null in keyed if null is not None) or "True"

    def constants(self) -> str:
        """Text of what does not change within a run."""
        p = self.parameter
        return "\n".join(
            [
                *(f"{name} = {p(name)}" for name in (
                    "piston_area_a", "piston_area_b", "stroke", "dead_volume_a", "dead_volume_b", "bulk_modulus",
                    "supply_pressure", "tank_pressure", "valve_leakage", "drive_limit", "orifice_transition",
                    "drive_force", "moving_mass",
                )),
                f"land_gain = {p('valve_flow')} / math.sqrt({p('valve_drop')})",
                "oil_compressibility = 1.0 / bulk_modulus",
                "area_ratio = piston_area_b / piston_area_a",
                "smallest_volume = 0.01 * min(dead_volume_a, dead_volume_b)",
            ]
        )  # fmt: skip


def places(layout: Layout) -> dict[str, object]:
    """What fills the places of the templates in `equations` for a library."""
    w = Writer(layout)
    stick = layout.states["stick"]
    shared = {name: w.slot(name) for name in slots.SLOTS}
    rhs = fill(
        RHS, **shared, stick=stick, stick_r=stick - layout.n_rates, dynamics=w.dynamics(),
        bristle_length=w.parameter("bristle_length"), bristle_time=w.parameter("bristle_time"),
    )  # fmt: skip
    return {
        "stick": stick, "n_rates": layout.n_rates, "n_states": len(layout.states), "n_outputs": len(base.OUTPUTS),
        "constants1": w.constants(), "switches1": w.switches(), "moving1": w.moving(), "rhs1": rhs, "rhs4": rhs,
        "switch_command": w.switch("command"), "drive_limit": w.parameter("drive_limit"),
        "area_ratio": f"{w.parameter('piston_area_b')} / {w.parameter('piston_area_a')}",
        "bend": REVERSAL_BEND, "shorter": REVERSAL_STEP, "most": MOST_SUBSTEPS,
        "command": shared["command"], "cut1": w.cut(),
        "position_sensor": shared["position_sensor"], "pressure_sensor": shared["pressure_sensor"],
        "position_sensor7": shared["position_sensor"], "pressure_sensor7": shared["pressure_sensor"],
    }  # fmt: skip


def write_module(library: Library) -> str:
    """The text of the module for this library: `rhs` and `run` (see `plant` for how they are called)."""
    functions = "\n".join(
        f'{e.name}__{which} = FUNCTIONS["{e.name}.{which}"]' for e in library.values() for which in e.functions()
    )
    return fill(MODULE, functions=functions, **places(Layout(library)))


def fill(template: str, **parts: object) -> str:
    """Put parts into a template; a part of several lines takes the indentation of its place."""
    lines = []
    for line in template.splitlines():
        stripped = line.strip()
        if stripped.startswith("{") and stripped.endswith("}") and stripped[1:-1] in parts:
            indent = line[: len(line) - len(line.lstrip())]
            lines.append(textwrap.indent(str(parts[stripped[1:-1]]).strip("\n"), indent))
        else:
            for name, value in parts.items():
                line = line.replace("{" + name + "}", str(value))
            lines.append(line)
    return "\n".join(lines) + "\n"
