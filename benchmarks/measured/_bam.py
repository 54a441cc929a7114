"""The friction models m1 … m6 of BAM and its error measure, written from their documentation, to stand beside ours.

A servo on a pendulum: τ_m + τ_e + τ_f = J·θ̈ with the gravity τ_e = −m·g·l·sin θ. Friction stops the arm within the step
where it can, and is at most a budget τ_fm, which the six models state (docs/theory/models.rst):

    m1: K_v|ω| + K_c                        m2: + e·K_cs,  e = exp(−|ω/ω_s|^α)
    m3: m1 + K_l|τ_m − τ_e|                 m4: m2 + K_l|τ_m − τ_e| + e·K_ls|τ_m − τ_e|
    m5: m2 + |K_m·τ_m − K_e·τ_e| + e·|K_ms·τ_m − K_es·τ_e|
    m6: m5 + e·K_eq·τ_e² where the motor drives, e·K_mq·τ_m² where it is driven

The measure is theirs (bam/mae.py): logs resampled to 5 ms by straight lines, a run from the first sample over the whole
log, the mean of |simulated − measured| per log, and of that the mean over logs.

M. Duclusaud, G. Passault, V. Padois, O. Ly, Extended Friction Models for the Physics Simulation of Servo Actuators
(2024).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.optimize import differential_evolution, minimize

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.estimation.parameters import scale

DT = 0.005  # s, of BAM's processed logs
GRAVITY = 9.80665
MODELS = ("m1", "m2", "m3", "m4", "m5", "m6")
XL330_GAIN = (4096 / (2 * math.pi)) / (256 * 885)  # duty per rad and firmware gain
VOLTAGE, TORQUE, STIFFNESS = 0, 1, 2

Array = np.ndarray


@dataclass(frozen=True)
class Log:
    """One log as BAM processes it: (N,) every 5 ms."""

    name: str
    trajectory: str
    kp: float
    vin: float
    mass: float
    arm_mass: float
    length: float
    damping: float
    goal: Array
    """Interpolated, as BAM has it."""
    held: Array
    """As it was sent: held until the next."""
    position: Array
    speed: Array
    enabled: Array


def read_log(path: Path) -> Log:
    """A raw log, every number of it interpolated to an even grid of 5 ms as bam/process.py does."""
    content = json.loads(path.read_text("utf-8"))
    entries = content["entries"]
    stamps = np.array([e["timestamp"] for e in entries])
    grid = np.arange(0.0, stamps[-1], DT)

    def column(key: str) -> Array:
        return np.interp(grid, stamps, [float(e[key]) for e in entries])

    number = {key: float(content.get(key, 0.0)) for key in ("kp", "vin", "mass", "arm_mass", "length", "damping")}
    return Log(
        path.stem, content["trajectory"], **number, goal=column("goal_position"),
        held=np.array([e["goal_position"] for e in entries])[np.searchsorted(stamps, grid + 1e-9) - 1],
        position=column("position"), speed=column("speed"), enabled=(column("torque_enable") > 0.5).astype(float),
    )  # fmt: skip


def read_logs(folder: Path) -> list[Log]:
    """All raw logs of a folder, in the order of their names."""
    return [read_log(path) for path in sorted(folder.glob("*.json"))]


@njit
def _roll(kind, a, f, offset, log, goal, enabled, position, speed, out):
    kp, vin, mass, arm_mass, length, damping = log
    inertia = (mass + arm_mass / 3.0) * length**2 + a[2]
    weight = -(mass + 0.5 * arm_mass) * GRAVITY * length
    q, w = position, speed
    for k in range(len(goal)):
        out[k] = q
        error = goal[k] - q
        if kind == VOLTAGE:
            duty = min(max(error * kp * a[3], -a[4]), a[4])
            motor = a[0] * (vin * duty - a[0] * w) / a[1]
        elif kind == TORQUE:
            motor = min(max(error * kp * a[0] - damping * w, -a[1]), a[1])
        else:
            motor = min(max(a[0] * error - a[1] * w, -a[3]), a[3])
            if abs(w) > a[4]:
                motor = 0.0
        motor *= enabled[k]
        load = weight * math.sin(q + offset)
        slow = math.exp(-(abs(w / f[8]) ** f[9]))
        budget = f[0] + abs(f[3] * load - f[2] * motor) + slow * (f[1] + abs(f[5] * load - f[4] * motor))
        if (load > 0.0) != (motor > 0.0):
            if abs(load) < abs(motor):
                budget += slow * f[7] * load * load
            elif abs(load) > abs(motor):
                budget += slow * f[6] * motor * motor
        net = motor + load
        stop = inertia / DT * w + net
        net -= math.copysign(min(abs(stop), budget + f[10] * abs(w)), stop)
        w = min(max(w + net / inertia * DT, -100.0), 100.0)
        q += w * DT + 0.5 * net / inertia * DT * DT


def _friction(p: Mapping[str, float]) -> Array:
    load = p.get("load_friction_base", 0.0)
    slow = p.get("load_friction_stribeck", 0.0)
    return np.array([
        p["friction_base"], p.get("friction_stribeck", 0.0),
        p.get("load_friction_motor", load), p.get("load_friction_external", load),
        p.get("load_friction_motor_stribeck", slow), p.get("load_friction_external_stribeck", slow),
        p.get("load_friction_motor_quad", 0.0), p.get("load_friction_external_quad", 0.0),
        p.get("dtheta_stribeck", 1.0), p.get("alpha", 1.0), p["friction_viscous"],
    ])  # fmt: skip


def _servo(motor: str, p: Mapping[str, float]) -> tuple[int, Array]:
    if motor == "xl330":
        return VOLTAGE, np.array([p["kt"], p["R"], p["armature"], XL330_GAIN, 1.0])
    if motor == "go1":
        return TORQUE, np.array([p["ratio"], p["max_torque"], p["armature"], 0.0, 0.0])
    return STIFFNESS, np.array([p["stiffness"], p["damping"], p["inertia"], 4.9, 7.853])


def bounds(motor: str, model: str) -> dict[str, tuple[float, float]]:
    """What BAM identifies, within its bounds (those of the inertia of the STS3250 as wide as the other motors')."""
    friction, load = (5.0, 2.0) if motor == "go1" else (0.2, 0.5)
    servo: dict[str, dict[str, tuple[float, float]]] = {
        "xl330": {"kt": (0.1, 3.0), "R": (2.0, 5.0), "armature": (1e-4, 0.05)},
        "go1": {"ratio": (0.5, 2.0), "max_torque": (20.0, 30.0), "armature": (1e-5, 2.0)},
        "sts3250": {"stiffness": (1.0, 500.0), "damping": (0.1, 10.0), "inertia": (1e-5, 0.05)},
    }
    found = {**servo[motor], "q_offset": (-0.1, 0.1), "friction_base": (0.0, friction)}
    if model in ("m2", "m4", "m5", "m6"):
        found |= {"friction_stribeck": (0.0, friction), "dtheta_stribeck": (0.1, 3.0), "alpha": (1.0, 10.0)}
    if model in ("m3", "m4"):
        found["load_friction_base"] = (0.0, load)
    if model == "m4":
        found["load_friction_stribeck"] = (0.0, 1.0)
    if model in ("m5", "m6"):
        found |= {f"load_friction_{side}": (0.0, load) for side in ("motor", "external")}
        found |= {f"load_friction_{side}_stribeck": (0.0, 1.0) for side in ("motor", "external")}
    if model == "m6":
        found |= {f"load_friction_{side}_quad": (0.0, 0.01) for side in ("motor", "external")}
    return {**found, "friction_viscous": (0.0, 1.0)}


def rollout(motor: str, parameters: Mapping[str, float], log: Log) -> Array:
    """Position (N,) [rad] that a model of BAM says."""
    out = np.empty(log.goal.size)
    kind, servo = _servo(motor, parameters)
    numbers = (log.kp, log.vin, log.mass, log.arm_mass, log.length, log.damping)
    _roll(
        kind, servo, _friction(parameters), parameters.get("q_offset", 0.0), numbers, log.goal, log.enabled,
        log.position[0], log.speed[0], out,
    )  # fmt: skip
    return out


def maes(motor: str, parameters: Mapping[str, float], logs: Sequence[Log]) -> Array:
    """Mean absolute error [rad] of a model of BAM on each log."""
    return np.array([np.mean(np.abs(rollout(motor, parameters, log) - log.position)) for log in logs])


def identified(motor: str, model: str, logs: Sequence[Log], generations: int = 400, seed: int = 0) -> dict[str, float]:
    """Parameters with the least mean absolute error on the logs, which is what bam/fit.py looks for."""
    allowed = bounds(motor, model)

    def cost(x: Array) -> float:
        return float(maes(motor, dict(zip(allowed, x.tolist(), strict=True)), logs).mean())

    done = differential_evolution(
        cost, list(allowed.values()), popsize=8, maxiter=generations, tol=1e-6, seed=np.random.default_rng(seed),
        mutation=(0.4, 0.9), polish=False,
    )  # fmt: skip
    return dict(zip(allowed, map(float, done.x), strict=True))


def our_rollout(plant: Plant, log: Log, goal: Array, released: Mapping[str, float]) -> Array:
    """Position (N,) of a model of this project over the same log; ``released``: what a motor without torque is."""
    state = plant.initial_state(position=float(log.position[0]), velocity=float(log.speed[0]), drive=float(goal[0]))
    parts, edges = [], np.flatnonzero(np.diff(log.enabled)) + 1
    for first, last in zip([0, *edges], [*edges, log.goal.size], strict=True):
        phase = plant if log.enabled[first] else plant.with_parameters(dict(released))
        run = phase.simulate(goal[first:last], DT, state)
        parts.append(run.position)
        state = run.final
    return np.concatenate(parts)


def our_maes(model: Model, logs: Sequence[Log], motor: Any) -> Array:
    """Mean absolute error [rad] of a model of this project on each log of a `measured._bam_motors.Motor`."""
    plant, released, found = Plant(model), {"position_loop.active": 0.0, "motor_damping.active": 0.0}, []
    for log in logs:
        beside = plant.with_parameters(motor.settings(log))
        run = our_rollout(beside, log, log.held if motor.held else log.goal, released)
        found.append(float(np.mean(np.abs(run - log.position))))
    return np.array(found)


def polished(model: Model, logs: Sequence[Log], motor: Any, trials: int = 600) -> Model:
    """The model's free parameters moved to the least mean absolute error on the logs, as bam/fit.py does with m1 … m6.

    A least-squares fit weighs frequencies by the sensor's noise; this measure weighs them alike.
    """
    keys = model.free_keys()
    sizes = np.array([0.3 * scale(model, key) for key in keys])
    begin = np.array([model.value(key) for key in keys])
    limits = np.array([model.entry(key).bounds for key in keys])

    def values(z: Array) -> dict[str, float]:
        return dict(zip(keys, np.clip(begin + z * sizes, *limits.T).tolist(), strict=True))

    def cost(z: Array) -> float:
        try:
            return float(our_maes(model.with_values(values(z)), logs, motor).mean())
        except SimulationError:
            return 1.0

    best = np.zeros(len(keys))
    for share in (0.5, 0.5):  # begun twice: that frees a simplex that has shrunk too early
        simplex = np.vstack([best, best + 0.5 * np.eye(len(keys))])
        options = {"initial_simplex": simplex, "maxfev": round(share * trials), "adaptive": True, "fatol": 1e-6}
        best = minimize(cost, best, method="Nelder-Mead", options=options).x
    return model.with_values(values(best), source="least mean absolute error on the records for fitting")


def main() -> None:
    """``python benchmarks/measured/_bam.py MOTOR FOLDER``: identify m1 … m6 on the records for fitting; JSON."""
    import sys

    from measured._bam_motors import MOTORS

    motor = MOTORS[sys.argv[1]]
    logs = [log for log in read_logs(Path(sys.argv[2])) if motor.fitted(log)]
    print(json.dumps({m: identified(motor.name, m, logs) for m in MODELS}, indent=1))


if __name__ == "__main__":
    main()
