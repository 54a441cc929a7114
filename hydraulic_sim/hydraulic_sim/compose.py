"""Effects become one flat right-hand side: the text of a module that numba compiles.

Every effect of a library is in the text, behind a switch, so that turning one on or off compiles nothing. The
plant's equations stand in `_RHS` once; they are written into the loop of the Runge–Kutta step (so that nothing is
called there that the compiler does not see through) and into a bare right-hand side for other solvers.

Layout of the arrays that the generated functions take:

- P (n_parameters,): base parameters, then each effect's (`Layout.parameters`);
- on (n_effects,): 1 where the effect is on; X (n_states,): rate states first, then relaxation states;
- M (n_memory,): the effects' memories.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from functools import cached_property

from . import base, slots
from .effect import Effect, State, arguments
from .registry import Library

SUBSTEP_SAFETY = 1.2  # substep × fastest pressure rate; RK4 is stable up to 2.78
REVERSAL_BEND = 0.02  # sliding within one step, of the bristle length, from which a reversal is refined
REVERSAL_STEP = 0.125  # and by how much
MOST_SUBSTEPS = 2000  # in one sample; beyond, the physics is called too stiff


@dataclass(frozen=True)
class Layout:
    """Where each parameter, state and memory of a library lies in the plant's arrays."""

    library: Library

    @cached_property
    def effects(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.library)}

    @cached_property
    def parameters(self) -> dict[str, int]:
        keys = [p.name for p in base.PARAMETERS]
        keys += [f"{e.name}.{p.name}" for e in self.library.values() for p in e.parameters]
        return {key: i for i, key in enumerate(keys)}

    @cached_property
    def state_records(self) -> dict[str, State]:
        every = {s.name: s for s in base.STATES}
        every |= {f"{e.name}.{s.name}": s for e in self.library.values() for s in e.states}
        by_kind = sorted(every.items(), key=lambda item: item[1].kind == "relaxation")
        return dict(by_kind)

    @cached_property
    def states(self) -> dict[str, int]:
        return {key: i for i, key in enumerate(self.state_records)}

    @cached_property
    def n_rates(self) -> int:
        return sum(s.kind == "rate" for s in self.state_records.values())

    @cached_property
    def memories(self) -> dict[str, slice]:
        found, start = {}, 0
        for effect in self.library.values():
            if effect.memory:
                found[effect.name] = slice(start, start + effect.memory)
                start += effect.memory
        return found

    @cached_property
    def n_memory(self) -> int:
        return max((s.stop for s in self.memories.values()), default=0)


class Writer:
    """Writes the calls of one library's effects."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout

    def members(self, slot: str) -> list[Effect]:
        return [e for e in self.layout.library.values() if e.slot == slot]

    def parameter(self, key: str) -> str:
        return f"P[{self.layout.parameters[key]}]"

    def call(self, effect: Effect, which: str = "kernel") -> str:
        return f"{effect.name}__{which}({', '.join(self._value(effect, a) for a in arguments(effect.functions()[which]))})"

    def _value(self, effect: Effect, argument: str) -> str:
        if argument in effect.parameter_names:
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
            lines += [f"if on[{self.layout.effects[effect.name]}]:", f"    {', '.join(lefts)} = {self.call(effect, 'dynamics')}"]
        return "\n".join(lines) if lines else "pass"

    def switches(self) -> str:
        """One flag per stage, so that a stage without effects costs one test."""
        lines = []
        for name in slots.SLOTS:
            indices = [self.layout.effects[e.name] for e in self.members(name)]
            test = " or ".join(f"on[{i}] != 0" for i in indices) or "False"
            lines.append(f"any_{name} = {test}")
        dry = [e.name for e in self.layout.library.values() if any("direction" in arguments(f) for f in e.functions().values())]
        lines.append("any_direction = " + (" or ".join(f"on[{self.layout.effects[n]}] != 0" for n in dry) or "False"))
        return "\n".join(lines)

    def constants(self) -> str:
        p = self.parameter
        return "\n".join(
            [
                *(f"{name} = {p(name)}" for name in (
                    "piston_area_a", "piston_area_b", "stroke", "dead_volume_a", "dead_volume_b", "bulk_modulus",
                    "supply_pressure", "tank_pressure", "valve_leakage", "drive_limit", "orifice_transition",
                    "drive_force", "moving_mass",
                )),
                f"land_gain = {p('valve_flow')} / math.sqrt({p('valve_drop')})",
                "smallest_volume = 0.01 * min(dead_volume_a, dead_volume_b)",
            ]
        )  # fmt: skip


_RHS = """
t = now
position = S[0]; velocity = S[1]; pressure_a = S[2]; pressure_b = S[3]; stick = S[{stick}]
load_pressure = pressure_a - pressure_b
viscosity = 1.0
{viscosity}
spool = command
{spool}
if hydraulic:
    opening = spool
    {opening}
    land_pa = max(opening, 0.0); land_at = max(-opening, 0.0); land_pb = land_at; land_bt = land_pa
    {lands}
    pressure_supply = supply_pressure
    {supply}
    {ripple}
    pressure_tank = tank_pressure
    {tank}
    drop = pressure_supply - pressure_a
    gain = land_gain * (land_pa + valve_leakage) * smooth_root_gain(drop, orifice_transition)
    flow_pa = gain * drop; slope_a = gain
    drop = pressure_a - pressure_tank
    gain = land_gain * (land_at + valve_leakage) * smooth_root_gain(drop, orifice_transition)
    flow_at = gain * drop; slope_a += gain
    drop = pressure_supply - pressure_b
    gain = land_gain * (land_pb + valve_leakage) * smooth_root_gain(drop, orifice_transition)
    flow_pb = gain * drop; slope_b = gain
    drop = pressure_b - pressure_tank
    gain = land_gain * (land_bt + valve_leakage) * smooth_root_gain(drop, orifice_transition)
    flow_bt = gain * drop; slope_b += gain
    flow_supply = flow_pa + flow_pb
    flow_tank = flow_at + flow_bt
    flow_a = flow_pa - flow_at
    flow_b = flow_pb - flow_bt
    {flow}
    volume_a = max(dead_volume_a + piston_area_a * (0.5 * stroke + position), smallest_volume)
    volume_b = max(dead_volume_b + piston_area_b * (0.5 * stroke - position), smallest_volume)
    compliance_a = volume_a / bulk_modulus
    compliance_b = volume_b / bulk_modulus
    {compliance}
    K[2] = (flow_a - piston_area_a * velocity) / compliance_a
    K[3] = (flow_b + piston_area_b * velocity) / compliance_b
    pressure_rate = max(slope_a / compliance_a, slope_b / compliance_b)
    drive_part = pressure_a * piston_area_a - pressure_b * piston_area_b
else:
    opening = spool
    pressure_supply = 0.0; pressure_tank = 0.0; flow_supply = 0.0; flow_tank = 0.0
    flow_a = 0.0; flow_b = 0.0; volume_a = 0.0; volume_b = 0.0
    K[2] = 0.0; K[3] = 0.0; pressure_rate = 0.0
    drive_part = drive_force * drive_limit * spool
bristle_length = {bristle_length}; bristle_time = {bristle_time}
{bristle}
turn = 1.0 if velocity >= 0.0 else -1.0
R[{stick_r}] = abs(velocity) / bristle_length
G[{stick_r}] = turn
direction = stick + bristle_time * R[{stick_r}] * (turn - stick)
force = 0.0
{force}
K[0] = velocity
K[1] = (drive_part + force) / moving_mass
{dynamics}
"""

_MODULE = '''
"""Generated by hydraulic_sim.compose; every edit is lost."""
import math
import numpy as np
from numba import njit
from hydraulic_sim.kernels import clamp, smooth_root_gain

{functions}

NR = {n_rates}
NX = {n_states}


@njit("f8(f8, f8, f8, f8)", error_model="numpy")
def relax(start, rate, goal, span):
    if rate == 0.0:
        return start
    return goal + (start - goal) * math.exp(-rate * span)


@njit("void(f8, f8[::1], f8, u1[::1], f8[::1], u1, f8[::1], f8[::1], f8[::1], f8[::1])",
      cache=True, nogil=True, error_model="numpy")
def rhs(now, S, command, on, P, hydraulic, K, R, G, AUX):
    {constants1}
    {switches1}
    {rhs1}
    AUX[0] = spool; AUX[1] = pressure_supply; AUX[2] = opening; AUX[3] = pressure_rate
    AUX[4] = flow_a; AUX[5] = flow_b; AUX[6] = force; AUX[7] = drive_part; AUX[8] = flow_supply
    AUX[9] = direction; AUX[10] = pressure_tank


@njit("i8(f8[::1], f8, f8, f8, u1[::1], f8[::1], u1, f8[::1], f8[::1], f8[:, ::1], f8[::1])",
      cache=True, nogil=True, error_model="numpy")
def run(drive, dt, start, max_step, on, P, hydraulic, X, M, Y, failure):
    """Integrates X over len(drive) samples; Y[k] is what is seen at sample k. Returns the samples done.

    failure: time, substeps in the failing sample (0: not finite, else: too stiff for the step)."""
    {constants1}
    {switches1}
    S = np.empty(NX); K = np.zeros(NX); R = np.zeros(NX - NR); G = np.zeros(NX - NR)
    slope = np.empty(NR); rates = np.empty(NX - NR); goals = np.empty(NX - NR)
    for k in range(len(drive)):
        now = start + k * dt
        t = now
        command = clamp(drive[k] / drive_limit, -1.0, 1.0)
        position = X[0]; velocity = X[1]; pressure_a = X[2]; pressure_b = X[3]
        load_pressure = pressure_a - pressure_b
        {command}
        remaining = dt
        count = 0
        while remaining > 0.0:
            h = 0.0
            span = 0.0
            for stage in range(4):
                if stage == 0:
                    for i in range(NX):
                        S[i] = X[i]
                else:
                    span = h if stage == 3 else 0.5 * h
                    for i in range(NR):
                        S[i] = X[i] + span * K[i]
                    for i in range(NX - NR):
                        S[NR + i] = relax(X[NR + i], R[i], G[i], span)
                now = start + k * dt + (dt - remaining) + span
                {rhs4}
                if stage == 0:
                    wanted = max_step
                    if pressure_rate * wanted > {safety}:
                        wanted = {safety} / pressure_rate
                    # a reversal of dry friction bends the trajectory: cross it in short steps
                    swing = abs(K[1]) * wanted
                    if any_direction and abs(velocity) < 2.0 * swing and swing * wanted > {bend} * bristle_length:
                        wanted *= {shorter}
                    if wanted < remaining:
                        h = remaining / math.ceil(remaining / wanted * 0.999999)
                    else:
                        h = remaining
                    if count == 0:
                        reading = position
                        if any_position_sensor:
                            {position_sensor7}
                        reading_a = pressure_a; reading_b = pressure_b
                        if any_pressure_sensor:
                            {pressure_sensor7}
                        Y[k, 0] = reading; Y[k, 1] = velocity; Y[k, 2] = reading_a; Y[k, 3] = reading_b
                        Y[k, 4] = pressure_supply; Y[k, 5] = spool; Y[k, 6] = position
                        Y[k, 7] = pressure_a; Y[k, 8] = pressure_b; Y[k, 9] = opening
                    for i in range(NR):
                        slope[i] = K[i]
                    for i in range(NX - NR):
                        rates[i] = R[i]; goals[i] = R[i] * G[i]
                else:
                    weight = 1.0 if stage == 3 else 2.0
                    for i in range(NR):
                        slope[i] += weight * K[i]
                    for i in range(NX - NR):
                        rates[i] += weight * R[i]; goals[i] += weight * R[i] * G[i]
            total = 0.0
            for i in range(NR):
                X[i] += h / 6.0 * slope[i]
                total += X[i]
            for i in range(NX - NR):
                if rates[i] > 0.0:
                    X[NR + i] = relax(X[NR + i], rates[i] / 6.0, goals[i] / rates[i], h)
            remaining = remaining - h if remaining - h > 1e-9 * dt else 0.0
            count += 1
            if not math.isfinite(total):
                failure[0] = now; failure[1] = 0.0
                return k
            if count >= {most}:
                failure[0] = now; failure[1] = count
                return k
    return len(drive)


@njit("void(f8[::1], f8, f8, u1[::1], f8[::1], f8[::1], f8[::1])", cache=True, nogil=True, error_model="numpy")
def prime(drive, dt, start, on, P, X, M):
    """Lets the memories of the command effects see a drive of the past; nothing moves."""
    {constants1}
    {switches1}
    position = X[0]; velocity = X[1]; pressure_a = X[2]; pressure_b = X[3]
    load_pressure = pressure_a - pressure_b
    if any_command:
        for k in range(len(drive)):
            t = start + k * dt
            command = clamp(drive[k] / drive_limit, -1.0, 1.0)
            {command}


@njit("i8(f8[::1], f8, f8, i8[::1], i8, i8, f8[:, ::1], i8, u1[::1], f8[::1], u1, f8[:, :, ::1], f8[::1])",
      cache=True, nogil=True, error_model="numpy")
def run_many(drive, dt, max_step, starts, count, past, states, n_memory, on, P, hydraulic, Y, failure):
    """Runs ``count`` samples from each start, the memories primed over ``past`` samples. Returns the starts done."""
    X = np.empty(NX)
    M = np.zeros(n_memory)
    for i in range(len(starts)):
        first = starts[i]
        before = max(first - past, 0)
        X[:] = states[i]
        M[:] = 0.0
        if past > 0:
            prime(drive[before:first], dt, before * dt, on, P, X, M)
        done = run(drive[first:first + count], dt, first * dt, max_step, on, P, hydraulic, X, M, Y[i], failure)
        if done < count:
            return i
    return len(starts)
'''



def write_module(library: Library) -> str:
    """The text of the module for this library: `rhs` and `run` (see `plant` for how they are called)."""
    layout = Layout(library)
    w = Writer(layout)
    stick = layout.states["stick"]
    shared = {name: w.slot(name) for name in slots.SLOTS}
    rhs = _fill(
        _RHS, **shared, stick=stick, stick_r=stick - layout.n_rates, dynamics=w.dynamics(),
        bristle_length=base.BRISTLE_LENGTH, bristle_time=base.BRISTLE_TIME,
    )  # fmt: skip
    functions = "\n".join(
        f'{e.name}__{which} = njit(FUNCTIONS["{e.name}.{which}"], error_model="numpy")'
        for e in library.values()
        for which in e.functions()
    )
    return _fill(
        _MODULE, functions=functions, n_rates=layout.n_rates, n_states=len(layout.states), constants1=w.constants(),
        switches1=w.switches(), rhs1=rhs, rhs4=rhs, safety=SUBSTEP_SAFETY, bend=REVERSAL_BEND, shorter=REVERSAL_STEP, most=MOST_SUBSTEPS,
        command=shared["command"], position_sensor7=shared["position_sensor"],
        pressure_sensor7=shared["pressure_sensor"],
    )  # fmt: skip


def _fill(template: str, **parts: object) -> str:
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
