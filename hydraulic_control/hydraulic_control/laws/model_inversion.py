"""Model inversion: the calibrated model file says which drive gives the speed that is wanted.

Two degrees of freedom: the demanded speed is that of the reference, led by the plant's lag, plus feedback of the error;
the inverse of the model's steady speed over the drive (`hydraulic_control.inverse`: dead band, gain curve, friction,
leakage, areas, whatever effects it has) turns it into a drive. The load that the transducers show shifts the flow
through the valve by the square root of the pressure drop (H. E. Merritt, Hydraulic Control Systems, 1967, ch. 5).

    v_d = v_r + T·dv_r/dt + λ·e + λ_i·∫e,   u = U(v_d·√(Δp_nominal(v_d)/Δp)),   Δp = p_s − p_t − sgn(v_d)·F/A
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hydraulic_control.law import Claim, Law, SimpleModel, Values, number
from hydraulic_control.law_parts import integrate
from hydraulic_node_utils.parameter_spec import ParameterSpec

_SIZE = 161


def design(values: Values) -> dict[str, Any]:
    """Drives (N,) over speeds (N,), force at each, and the lag; a straight line without a model file."""
    name = values["model_inversion.model"]
    if name:
        from hydraulic_control.inverse import inverse  # the simulation is needed where a model file is named, only

        return inverse(name, _SIZE)._asdict()
    drives = np.linspace(-10.0, 10.0, _SIZE)
    zero, gain = np.zeros(_SIZE), values["model_inversion.velocity_gain"]
    return {"drives": drives, "speeds": gain * drives, "forces": zero, "lag": 5e-3, "pressure": 1.0, "area": 0.0}


def begin(p: Any, s: Any, position: float) -> None:
    """At rest."""
    s.load = s.slow_force


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The drive [V] for the speed that is wanted."""
    s.acceleration += dt / (p.acceleration_time + dt) * ((reference_velocity - s.last) / dt - s.acceleration)
    s.last = reference_velocity
    demand = reference_velocity + p.lag * s.acceleration
    demand += p.feedback * (reference - position) + p.integral * s.integral
    if p.area > 0.0 and math.isfinite(s.force):
        s.load += dt / (p.load_time + dt) * (s.force - s.load)
        side = p.area if demand >= 0.0 else -p.area
        nominal = p.pressure - np.interp(demand, p.speeds, p.forces) / side
        drop = max(p.pressure - s.load / side, 0.1 * p.pressure)
        demand *= min(max(math.sqrt(max(nominal, 0.1 * p.pressure) / drop), 0.7), 1.4)
    if abs(demand) < p.spread:
        edge = math.copysign(p.spread, demand)
        return demand / edge * np.interp(edge, p.speeds, p.drives)
    return np.interp(demand, p.speeds, p.drives)


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the integral."""
    slope = (p.drives[-1] - p.drives[0]) / (p.speeds[-1] - p.speeds[0])
    integrate(p, s, dt, e, slope * p.integral, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several bandwidths; the model file is named by who tunes."""
    common = {"model_inversion.velocity_gain": simple.velocity_gain}
    return [{**common, "model_inversion.feedback": w} for w in (10.0, 20.0, 30.0)]


LAW = Law(
    description="model inversion from the calibrated model file, two degrees of freedom",
    source="flatness of the flow balance; Merritt 1967, ch. 5",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(
        ParameterSpec("model_inversion.model", "", "model file or preset that is inverted; '': a straight line"),
        number("model_inversion.velocity_gain", 0.0434, "of the straight line", "m/(s*V)", 1e-6, 10.0),
        number("model_inversion.feedback", 30.0, "λ, speed per error", "1/s", 0.0, 500.0),
        number("model_inversion.integral", 400.0, "λ_i", "1/s2", 0.0, 1e5),
        number("model_inversion.spread", 1e-3, "demanded speed over which a dead band is crossed", "m/s", 1e-6, 1.0),
        number("model_inversion.load_time", 0.05, "over which the load is taken for steady", "s", 1e-3, 10.0),
        number("model_inversion.acceleration_time", 4e-3, "filter on the reference's acceleration", "s", 0.0, 1.0),
    ),
    state=tuple((n, ()) for n in ("acceleration", "last", "load")),
    derived=(*((n, (_SIZE,)) for n in ("drives", "speeds", "forces")), *((n, ()) for n in ("lag", "pressure", "area"))),
    design=design,
    tuned=("model_inversion.feedback", "model_inversion.spread"),  # steps say little of the integral, which tracks
    starts=starts,
    needs="model file",
    claims=(Claim("follows a sine with a third of the error of PID", "sine", "rms_error", over="pid", high=0.33),),
)
