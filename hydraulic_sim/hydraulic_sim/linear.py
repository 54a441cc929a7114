"""Linearisation of the plant around an operating point, and the closed forms of the third-order model.

    G(s) = K_v / ( s·(s²/ω² + 2·ζ·s/ω + 1) ),   K_v = K_q/A,   ω = A·√(4·β/(V_t·M))
    ζ = (K_c + C_t)/A·√(β·M/V_t) + b/(4·A)·√(V_t/(β·M))

Merritt (1967), Hydraulic Control Systems, ch. 6 (symmetric piston in mid stroke).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from . import base
from .arrays import Array
from .effect import arguments
from .errors import SimulationError
from .model import Model
from .plant import Plant

if TYPE_CHECKING:  # it takes a second to import, and only those who ask for its objects need it
    import control

_FRACTION = 1e-5  # difference step, of a state's scale


@dataclass(frozen=True)
class OperatingPoint:
    """Steady motion at a constant drive: position [m], drive [V], velocity [m/s], pressures [Pa]."""

    position: float
    drive: float
    velocity: float
    pressure_a: float
    pressure_b: float
    state: Array


@dataclass(frozen=True)
class ClosedForm:
    """The third-order model's constants.

    Flow gain [m³/(s·V)], flow-pressure coefficient [m³/(s·Pa)], velocity gain [m/(s·V)], natural frequency [rad/s] and
    damping ratio.
    """

    flow_gain: float
    flow_pressure: float
    velocity_gain: float
    natural_frequency: float
    damping: float

    def transfer_function(self) -> control.TransferFunction:
        """Drive [V] to position [m]."""
        import control

        w, z = self.natural_frequency, self.damping
        return control.TransferFunction([self.velocity_gain], [1.0 / w**2, 2.0 * z / w, 1.0, 0.0])


def linearise(model: Model, position: float = 0.0, drive: float = 0.0) -> control.StateSpace:
    """State space from the drive [V] to (position [m], p_A [Pa], p_B [Pa]), by central differences.

    Dry friction is left out: it has no linear part (its describing function depends on the amplitude). Effects that
    act per sample (dead time, play, sensor lag) are not part of it either. States are named.

    :raises SimulationError: no steady motion exists at that drive.
    """
    import control

    plant, active = _smooth_plant(model)
    point = operating_point(model, position, drive)
    names, places = list(active), list(active.values())
    a = _state_matrix(plant, places, point)
    h = 1e-4 * plant.value("drive_limit")
    difference = plant.derivative(point.state, drive + h)[0] - plant.derivative(point.state, drive - h)[0]
    b = difference[places] / (2.0 * h)
    outputs = [n for n in ("position", "pressure_a", "pressure_b") if n in names]
    c = np.eye(len(names))[[names.index(name) for name in outputs]]
    return control.ss(
        a, b[:, None], c, np.zeros((len(outputs), 1)), states=names, inputs=["drive"], outputs=outputs, name=model.name
    )


def poles(model: Model) -> Array:
    """Poles (n,) [rad/s] of `linearise` at rest in mid stroke.

    :raises SimulationError: no steady motion exists there.
    """
    plant, active = _smooth_plant(model)
    return np.asarray(np.linalg.eigvals(_state_matrix(plant, list(active.values()), operating_point(model))))


def _state_matrix(plant: Plant, places: list[int], point: OperatingPoint) -> Array:
    """Derivatives (n, n) of the states' rates by the states at ``places``."""
    a = np.empty((len(places), len(places)))
    for j, index in enumerate(places):
        h = _FRACTION * list(plant.layout.state_records.values())[index].scale
        up, down = point.state.copy(), point.state.copy()
        up[index] += h
        down[index] -= h
        difference = plant.derivative(up, point.drive)[0] - plant.derivative(down, point.drive)[0]
        a[:, j] = difference[places] / (2.0 * h)
    return a


def operating_point(model: Model, position: float = 0.0, drive: float = 0.0) -> OperatingPoint:
    """The steady motion at a constant drive, dry friction left out.

    :raises SimulationError: there is none.
    """
    plant, active = _smooth_plant(model)
    start = plant.initial_state(position=position, drive=drive).states
    moving = [i for name, i in active.items() if name != "position"]
    scales = np.array([s.scale for s in plant.layout.state_records.values()])
    rate = max(1.0, abs(plant.derivative(start, drive)[1]["pressure_rate"]))

    def residual(scaled: Array) -> Array:
        state = start.copy()
        state[moving] = scaled * scales[moving]
        return plant.derivative(state, drive)[0][moving] / scales[moving] / rate

    found = least_squares(residual, start[moving] / scales[moving], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    # At rest a closed valve holds any common pressure, so that the residual counts and not the solution's spread.
    worst = float(np.max(np.abs(found.fun)))
    if not worst < 1e-6:
        raise SimulationError(
            f"{model.name}: no steady motion at {drive:g} V and x = {position:g} m (residual {worst:.2g})"
        )
    state = start.copy()
    state[moving] = found.x * scales[moving]
    return OperatingPoint(position, drive, float(state[1]), float(state[2]), float(state[3]), state)


def closed_form(model: Model) -> ClosedForm:
    """The third-order model of a symmetric actuator around rest in mid stroke.

    Flow gain of a critical-centre valve at no load, K_q = Q_r/√Δp_r·√((p_S − p_T)/2)/u_max; K_c from what the lands
    leak when shut.

    :raises SimulationError: unequal piston areas.
    """
    area = model.value("piston_area_a")
    if abs(area / model.value("piston_area_b") - 1.0) > 1e-3:
        raise SimulationError(f"{model.name}: the closed form holds for equal piston areas (Merritt 1967, ch. 6)")

    def on(effect: str, name: str) -> float:
        return model.value(f"{effect}.{name}") if effect in model.effects else 0.0

    half_drop = 0.5 * (model.value("supply_pressure") - model.value("tank_pressure"))
    land = _land(model)
    flow_gain = land * math.sqrt(half_drop) / model.value("drive_limit")
    flow_pressure = land * model.value("valve_leakage") / (2.0 * math.sqrt(half_drop))
    volume = area * model.value("stroke") + model.value("dead_volume_a") + model.value("dead_volume_b")
    beta, mass = model.value("bulk_modulus"), model.value("moving_mass")
    leak = flow_pressure + on("internal_leakage", "coefficient")
    damping = leak / area * math.sqrt(beta * mass / volume) + on("viscous_friction", "coefficient") / (
        4.0 * area
    ) * math.sqrt(volume / (beta * mass))
    return ClosedForm(
        flow_gain=flow_gain,
        flow_pressure=flow_pressure,
        velocity_gain=flow_gain / area,
        natural_frequency=area * math.sqrt(4.0 * beta / (volume * mass)),
        damping=damping,
    )


def velocity_gain(model: Model) -> float:
    """Speed per volt [m/(s·V)] of a piston without load, the mean of both directions; of any areas.

    Two orifices in series, ṽ = q·√((p_S − p_T·A_out/A_in)/(A_in² + A_out³/A_in)) with q the flow of a land per volt and
    √Pa (N. D. Manring, Hydraulic Control Systems, 2005, sec. 4); for equal areas that of `closed_form`. Of a mechanical
    axis: the force of the drive over the viscous friction.

    :raises SimulationError: a mechanical axis without viscous friction: its drive gives no speed.
    """
    if model.kind == "mechanical":
        drag = model.value("viscous_friction.coefficient") if "viscous_friction" in model.effects else 0.0
        if not drag > 0.0:
            raise SimulationError(f"{model.name}: a mechanical axis without viscous friction has no velocity gain")
        return abs(model.value("drive_force")) / drag
    land = _land(model) / model.value("drive_limit")
    supply, tank = model.value("supply_pressure"), model.value("tank_pressure")
    areas = model.value("piston_area_a"), model.value("piston_area_b")
    speeds = [
        land * math.sqrt(max(supply - tank * out / into, 0.0) / (into**2 + out**3 / into))
        for into, out in (areas, areas[::-1])
    ]
    return 0.5 * sum(speeds)


def _land(model: Model) -> float:
    """Flow of a fully open land over the root of its pressure drop [m³/(s·√Pa)]."""
    return model.value("valve_flow") / math.sqrt(model.value("valve_drop"))


def _smooth_plant(model: Model) -> tuple[Plant, dict[str, int]]:
    """The plant without dry friction, and the states that take part."""
    smooth = model
    for name in model.effects:
        effect = model.library[name]
        if any("direction" in arguments(f) for f in effect.functions().values()):
            smooth = smooth.without_effect(name)
    plant = Plant(smooth)
    owners = {*(s.name for s in base.STATES)} - {"stick"}
    if model.kind == "mechanical":
        owners -= {"pressure_a", "pressure_b"}
    active = {
        key: i
        for key, i in plant.layout.states.items()
        if key in owners or key.partition(".")[0] in smooth.effects and "." in key
    }
    return plant, active
