"""What each subsystem can do to the balances: the regressors that its faults are made of.

None of them is an effect of the library. A subsystem is allowed any smooth function of the variables that its physics
can depend on, acting where its physics acts: a force in the force balance alone; an opening in both flows, by the root
of each open land's drop, with opposite signs; leakage by the pressures; oil by the rate of the pressures; the supply in
the flow of the side that it feeds; a position sensor in both flows by the areas and in the force by the mass. A fault
that no file of the library knows is a sum of these all the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from hydraulic_sim.arrays import Array
from hydraulic_sim.effect import arguments
from hydraulic_sysid.data.resampling import delayed

from .basis import Knots, hat_functions, lagged, play, rate_limited
from .plant_signals import Signals

LAGS = (1e-3, 2e-3, 4e-3, 8e-3, 16e-3, 32e-3, 64e-3)
"""Seconds by which a valve may follow its drive."""
_SUPPLY_LAGS = (0.1, 1.0)
_WIDTHS = (0.003, 0.01, 0.03)
_UNRESOLVED = (2.0, 6.0)  # standard deviations of the position's noise over which dry friction turns around
_LATE = 5e-3  # s
_GAPS = (1e-4, 5e-4, 2e-3)
_RATES = (1.0, 3.0, 10.0, 30.0)
_RESONANCES = (3.5, 5.0, 7.0, 10.0, 14.0, 20.0, 28.0, 40.0)
_CREEP = (0.01, 0.03, 0.1)


@dataclass
class Regressors:
    """Those of one subsystem: parallel lists of the variable each is a function of, and what it adds per balance."""

    subsystem: str
    variables: list[str] = field(default_factory=list)
    parts: list[dict[str, Array]] = field(default_factory=list)

    def add(self, variable: str, **parts: Array) -> None:
        """One regressor; ``parts`` are (n,) by balance."""
        self.variables.append(variable)
        self.parts.append(parts)


def subsystem_regressors(s: Signals, balances: tuple[str, ...], k: Knots, waves: Array) -> Iterator[Regressors]:
    """All subsystems that these balances can show, one at a time, as each is large.

    ``waves`` (W, n) are oscillations that any of them may have.
    """
    if "force" in balances:
        yield _force(s, k, waves)
    if not s.hydraulic:
        yield _drive(s, k)
        yield _sensor(s, k, waves)
    elif "flow_a" in balances or "flow_b" in balances:
        yield _valve(s, k, waves, "spool" in balances)
        yield _flow(s, k)
        yield _fluid(s, k)
        yield _supply(s, k, waves, "supply" in balances)
        yield _sensor(s, k, waves)
    else:
        if "spool" in balances:
            yield _valve(s, k, waves, True)
        if "supply" in balances:
            yield _supply(s, k, waves, True)


def reversal_regressors(s: Signals, noise: float) -> Array:
    """Forces ``(T, n)`` by which laws of dry friction differ while it turns around, none for a model without any.

    Within a few times what the position sensor resolves (``noise`` [m]) no motion is seen that distinguishes the laws,
    and a smoothed velocity changes its sign early or late: neither is a fault of the model.
    """
    model = s.plant.model
    dry = any("direction" in arguments(f) for e in model.effects for f in model.library[e].functions().values())
    if not dry:
        return np.zeros((0, s.time.size))
    late = max(1, int(round(_LATE / s.dt)))
    early = np.concatenate((s.direction[late:], np.full(late, s.direction[-1])))
    gaps = [times * noise for times in _UNRESOLVED]
    turns = [(s.position - play(s.position, 0.5 * gap)) / gap for gap in gaps]
    return np.array([early - s.direction, delayed(s.direction, late) - s.direction, *turns])


def _force(s: Signals, k: Knots, waves: Array) -> Regressors:
    f = Regressors("force")
    for wave in waves:
        f.add("frequency", force=wave)
    way = s.direction
    for hat in hat_functions(s.velocity, k.velocity):
        f.add("velocity", force=hat)
    f.add("direction", force=way)
    f.add("direction", force=np.abs(way))
    for hat in hat_functions(s.position, k.position):
        f.add("position", force=hat)
        f.add("position", force=hat * way)
    for hat in hat_functions(s.time, k.time):
        for by in (np.ones_like(way), way, s.velocity):
            f.add("time", force=hat * by)
    if s.hydraulic:
        for hat in hat_functions(s.load_pressure, k.load):
            f.add("load_pressure", force=hat * way)
        f.add("load_pressure", force=s.load_pressure)
        f.add("load_pressure", force=(s.pressure_a + s.pressure_b) * way)
    f.add("acceleration", force=s.motion.acceleration)
    for frequency in _RESONANCES:
        follow = _resonance(s.motion.acceleration, frequency, s.dt)
        f.add("frequency", force=follow)
        f.add("frequency", force=np.gradient(follow))
    for gap in _GAPS:
        f.add("reversal", force=(s.position - play(s.position, 0.5 * gap)) / gap)
    reach = float(np.abs(s.position).max()) or 1.0
    near = np.maximum(np.abs(s.position) / reach - 0.7, 0.0) / 0.3
    outward = np.maximum(np.sign(s.position) * s.velocity, 0.0)
    for power in (0, 1, 2):
        f.add("position", force=np.sign(s.position) * near * outward**power)
    return f


def _valve(s: Signals, k: Knots, waves: Array, spool: bool) -> Regressors:
    f, demand = Regressors("valve"), s.drive
    gain_a, gain_b = s.opening_gains()

    def add(variable: str, change: Array) -> None:
        """A change of opening: in the flows, or where the spool is measured in the spool."""
        f.add(variable, flow_a=gain_a * change, flow_b=gain_b * change)
        if spool:
            f.add(variable, spool=change)

    for wave in waves:
        add("frequency", wave)
    for hat in hat_functions(demand, k.drive):
        add("opening", hat)
    for lag in LAGS:
        add("history", delayed(demand, max(1, int(round(lag / s.dt)))) - demand)
    for width in _WIDTHS:
        add("history", play(demand, width) - demand)
    for rate in _RATES:
        add("history", rate_limited(demand, rate * s.dt) - demand)
    for hat in hat_functions(s.time, k.time):
        add("time", hat)
        add("time", hat * demand)
    pa, at, pb, bt = s.drops()
    out = demand >= 0.0
    for drop in (np.where(out, pa, pb), np.where(out, bt, at)):
        add("pressure", demand * drop)  # flow forces close the spool (Merritt 1967, ch. 5)
    centre_a, centre_b = s.centre_gains()
    for width in (*_WIDTHS, 0.1, np.inf):
        near = np.maximum(1.0 - np.abs(demand) / width, 0.0)
        f.add("opening", flow_a=near * centre_a, flow_b=near * centre_b)
    return f


def _drive(s: Signals, k: Knots) -> Regressors:
    """What turns the drive into the force of a mechanical plant."""
    f = Regressors("valve")
    full = s.plant.value("drive_force") * s.plant.value("drive_limit")
    for hat in hat_functions(s.drive, k.drive):
        f.add("drive", force=-full * hat)
    for lag in LAGS:
        f.add("history", force=full * (s.drive - delayed(s.drive, max(1, int(round(lag / s.dt))))))
    for width in _WIDTHS:
        f.add("history", force=full * (s.drive - play(s.drive, width)))
    return f


def _flow(s: Signals, k: Knots) -> Regressors:
    f = Regressors("flow")
    load, none = s.load_pressure, np.zeros_like(s.time)

    def leak(variable: str, flow: Array) -> None:
        f.add(variable, flow_a=-flow, flow_b=flow)

    for hat in hat_functions(load, k.leak_load):
        leak("load_pressure", hat)
    leak("load_pressure", load)
    leak("load_pressure", np.sign(load) * np.sqrt(np.abs(load)))
    for hat in hat_functions(s.position, k.leak_position):
        leak("position", hat * load)
    for hat in hat_functions(s.time, k.time):
        leak("time", hat * load)
    for p, side in ((s.pressure_a, "flow_a"), (s.pressure_b, "flow_b")):
        for shape in (none + 1.0, p, np.sqrt(np.maximum(p, 0.0))):
            f.add("pressure", **{side: -shape})
    return f


def _fluid(s: Signals, k: Knots) -> Regressors:
    f = Regressors("fluid")
    stored_a, stored_b = -s.capacity_a * s.rate_a, -s.capacity_b * s.rate_b
    for in_a, in_b in zip(
        hat_functions(s.pressure_a, k.pressure), hat_functions(s.pressure_b, k.pressure), strict=True
    ):
        f.add("pressure", flow_a=in_a * stored_a, flow_b=in_b * stored_b)
    for power in (1, 2):
        thin_a, thin_b = (np.maximum(p, 1e5) ** -power for p in (s.pressure_a, s.pressure_b))
        f.add("pressure", flow_a=thin_a * stored_a, flow_b=thin_b * stored_b)
    f.add("rate", flow_a=-s.rate_a, flow_b=-s.rate_b)
    for time in _CREEP:
        f.add("history", flow_a=-lagged(s.rate_a, s.dt, time, 0.0), flow_b=-lagged(s.rate_b, s.dt, time, 0.0))
    f.add("rate", flow_a=-s.rate_a)
    f.add("rate", flow_b=-s.rate_b)
    on = s.plant.model.effects
    friction = s.plant.value("viscous_friction.coefficient") if "viscous_friction" in on else 0.0
    leakage = s.plant.value("internal_leakage.coefficient") if "internal_leakage" in on else 0.0
    for hat in hat_functions(s.time, k.time):
        f.add("time", flow_a=hat * stored_a, flow_b=hat * stored_b)
        if friction or leakage:
            thinner = leakage * hat * s.load_pressure
            f.add("time", force=-friction * hat * s.velocity, flow_a=thinner, flow_b=-thinner)
    return f


def _supply(s: Signals, k: Knots, waves: Array, measured: bool) -> Regressors:
    f = Regressors("supply")
    supply_a, supply_b = s.supply_gains()
    tank_a, tank_b = s.tank_gains()
    drawn = np.maximum(np.maximum(s.flow_a, s.flow_b), 0.0)
    returned = np.maximum(np.maximum(-s.flow_a, -s.flow_b), 0.0)

    def add(variable: str, by_drawn: Array, by_returned: Array | None = None) -> None:
        f.add(variable, flow_a=supply_a * by_drawn, flow_b=supply_b * by_drawn)
        if measured:
            f.add(variable, supply=by_drawn)
        other = by_drawn if by_returned is None else by_returned
        f.add(variable, flow_a=tank_a * other, flow_b=tank_b * other)

    for hat in hat_functions(s.time, k.time):
        add("time", hat)
    for wave in waves:
        add("frequency", wave)
    add("flow", drawn, returned)
    add("flow", drawn**2, returned**2)
    for time in _SUPPLY_LAGS:
        add("flow", lagged(drawn, s.dt, time), lagged(returned, s.dt, time))
    return f


def _sensor(s: Signals, k: Knots, waves: Array) -> Regressors:
    f = Regressors("sensor")
    mass = s.plant.value("moving_mass")
    area_a = s.plant.value("piston_area_a") if s.hydraulic else 0.0
    area_b = s.plant.value("piston_area_b") if s.hydraulic else 0.0

    def add(variable: str, rate: Array, change: Array) -> None:
        """An error of the position whose derivatives are ``rate`` and ``change``."""
        f.add(variable, force=mass * change, flow_a=area_a * rate, flow_b=-area_b * rate)

    for hat in hat_functions(s.position, k.position):
        add("position", hat * s.motion.velocity, hat * s.motion.acceleration)
    for wave in waves:
        rate = np.gradient(wave, s.dt)
        add("frequency", rate, np.gradient(rate, s.dt))
    add("acceleration", s.motion.acceleration, s.motion.jerk)
    add("acceleration", s.motion.jerk, np.gradient(s.motion.jerk, s.dt))
    for frequency in _RESONANCES:
        sway = _resonance(s.motion.acceleration, frequency, s.dt)
        rate = np.gradient(sway, s.dt)
        change = np.gradient(rate, s.dt)
        add("frequency", rate, change)
        add("frequency", change, np.gradient(change, s.dt))
    for gap in _GAPS:
        within = np.abs(s.position - play(s.position, 0.5 * gap)) < 0.499 * gap
        add("reversal", within * s.motion.velocity, within * s.motion.acceleration)
    for hat in hat_functions(s.time, k.time):
        add("time", hat, np.zeros_like(hat))
    if s.hydraulic:
        _pressure_sensors(s, f, area_a, area_b)
    return f


def _pressure_sensors(s: Signals, f: Regressors, area_a: float, area_b: float) -> None:
    supply_a, supply_b = s.supply_gains()
    tank_a, tank_b = s.tank_gains()
    sides = (
        ("flow_a", -area_a, s.pressure_a, s.motion.rate_a, s.capacity_a, supply_a + tank_a),
        ("flow_b", area_b, s.pressure_b, s.motion.rate_b, s.capacity_b, supply_b + tank_b),
    )
    still = np.zeros_like(s.time)
    for flow, area, pressure, rate, capacity, slope in sides:
        # A reading too high asks for less force, shows a faster rise, and lets the lands give less.
        for error, change in ((still + 1.0, still), (pressure, rate), (rate, np.gradient(rate, s.dt))):
            f.add("pressure", force=area * error, **{flow: capacity * change + slope * error})


def _resonance(signal: Array, frequency: float, dt: float) -> Array:
    """What a second mass on a lightly damped spring of this frequency does in answer (static gain 1)."""
    turn = 2.0 * np.pi * frequency * dt
    poles = [1.0, -2.0 * np.exp(-0.1 * turn) * np.cos(turn), np.exp(-0.2 * turn)]
    return lfilter([sum(poles)], poles, signal)
