"""Constrained model predictive control on K/(s(Ts + 1)), free of offset by an observed drift.

C. Liang et al. 2019; S. Xavier et al. 2018. J. M. Maciejowski, Predictive Control, 2002, ch. 3: condensed, moves in
blocks. Over N samples Σ(x − x_r)² + ρ·Σ(Δu)² is least within the limits of drive, slew and travel: the optimum without
limits where it keeps them, else that of DAQP (D. Arnström et al., IEEE Trans. Autom. Control 67, 2022); travel yields.
"""

from __future__ import annotations

import math
from typing import Any

import daqp
import numpy as np
from numba import objmode

from hydraulic_control.law import Claim, Law, SimpleModel, Values, model_parameters, model_values, number
from hydraulic_control.law_parts import end_observer

_BLOCKS = (1, 2, 3, 5, 9)
_N, _M = sum(_BLOCKS), len(_BLOCKS)
_ENDS = tuple(int(k) - 1 for k in np.cumsum(_BLOCKS))
_SENSE = np.array([0] * (_M + 1) + [8] * _M, dtype=np.int32)  # 8: may be violated, at a price


def design(values: Values) -> dict[str, Any]:
    """Responses (N,) to a velocity and (N, M) to the blocks; H (M, M), its inverse, and rows of slew and travel."""
    gain, lag, period = (values[f"mpc.{name}"] for name in ("velocity_gain", "lag", "period"))
    time = period * np.arange(_N + 1.0)
    step = gain * (time - lag * (1.0 - np.exp(-time / lag)))  # response to a unit step
    begins = np.concatenate(([0], np.cumsum(_BLOCKS)))
    late = np.maximum(np.arange(1, _N + 1)[:, None] - begins[None, :], 0)
    acts = step[late[:, :-1]] - step[late[:, 1:]]
    acts[:, -1] = step[late[:, -2]]  # the last move is held
    moves = np.eye(_M) - np.eye(_M, k=-1)
    hessian = acts.T @ acts + values["mpc.smoothness"] * moves.T @ moves
    rows = np.vstack((np.eye(1, _M), acts[list(_ENDS)]))
    coast = lag * (1.0 - np.exp(-time[1:] / lag))
    return {"coast": coast, "acts": acts, "hessian": hessian, "inverse": np.linalg.inv(hessian), "rows": rows}


def begin(p: Any, s: Any, position: float) -> None:
    """The model at rest where the piston is."""
    s.model_position, s.clock = position, p.period


def solved(hessian: np.ndarray, f: np.ndarray, rows: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """(M,) the best moves within the limits."""
    return np.ascontiguousarray(daqp.solve(hessian, f, rows, upper, lower, _SENSE)[0], dtype=np.float64)


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The first move [V], a new one every period."""
    s.clock += dt
    if s.clock < p.period - 0.5 * dt:
        return s.held
    s.clock = 0.0
    free = np.empty(_N)
    for k in range(_N):
        ahead = (k + 1) * p.period
        free[k] = position - reference + s.model_velocity * p.coast[k] + (s.drift - reference_velocity) * ahead
    f = p.acts.T @ free
    f[0] -= p.smoothness * s.drive
    best = -(p.inverse @ f)
    upper, lower = np.empty(2 * _M + 1), np.empty(2 * _M + 1)
    upper[:_M], lower[:_M] = p.drive_limit, -p.drive_limit
    upper[_M], lower[_M] = s.drive + p.slew_limit * p.period, s.drive - p.slew_limit * p.period
    for i in range(_M):
        known = free[_ENDS[i]] + reference + reference_velocity * (_ENDS[i] + 1) * p.period
        upper[_M + 1 + i], lower[_M + 1 + i] = p.travel - known, -p.travel - known
    kept = True
    for i in range(_M):
        kept = kept and lower[i] <= best[i] <= upper[i]
    reached = p.rows @ best
    for i in range(_M + 1):
        kept = kept and lower[_M + i] <= reached[i] <= upper[_M + i]
    if not kept and math.isfinite(f.sum()):
        hessian, rows = p.hessian.copy(), p.rows.copy()
        with objmode(best="float64[::1]"):
            best = solved(hessian, f, rows, upper, lower)
    s.held = best[0] if math.isfinite(best[0]) else 0.0
    return s.held


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several weights of the moves."""
    return [{**model_values("mpc", simple), "mpc.smoothness": w} for w in (1e-8, 1e-7, 1e-6)]


LAW = Law(
    description="constrained model predictive control (MPC), offset-free",
    source="Liang 2019, Xavier 2018; Maciejowski 2002",
    begin=begin,
    drive=drive,
    end=end_observer,
    parameters=(
        *model_parameters("mpc"),
        number("mpc.period", 5e-3, "sampling time of the prediction", "s", 1e-3, 0.1),
        number("mpc.smoothness", 1e-7, "ρ, weight of a move", "m2/V2", 1e-12, 1.0),
        number("mpc.observer", 30.0, "poles of the observer of position and drift", "rad/s", 0.1, 300.0),
        number("mpc.travel", 100.0, "largest position to either side", "m", 1e-3, 100.0),
    ),
    state=tuple((n, ()) for n in ("clock", "held", "model_position", "model_velocity", "drift")),
    derived=(
        ("coast", (_N,)),
        ("acts", (_N, _M)),
        ("hessian", (_M, _M)),
        ("inverse", (_M, _M)),
        ("rows", (_M + 1, _M)),
    ),
    design=design,
    tuned=("mpc.period", "mpc.smoothness", "mpc.observer"),
    starts=starts,
    needs="identified model",
    claims=(
        Claim("at least as good as PFC without a disturbance (Liang 2019)", "sine", "rms_error", over="pfc", high=1.02),
        Claim("at least as good as PFC with one (Liang 2019)", "load_step", "largest_error", over="pfc", high=1.02),
    ),
)
