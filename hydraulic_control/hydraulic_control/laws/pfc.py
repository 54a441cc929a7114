"""Predictive functional control of an integrating process: one coincidence point, one basis function.

[1] J. Richalet, D. O'Donovan, Elementary predictive functional control, Advanced Control Engineering 2009: an
integrating
    process is predicted from where it is measured; the reference trajectory closes in with e^(−3t/t_r).
[2] M. I. Izzuddin et al. 2015; J. Richalet et al. 2011 on an electro-hydraulic servo.

With the model K/(s(Ts + 1)), velocity v and a drift d, both observed, after the horizon h

    x(h) = x + v·T·(1 − e^(−h/T)) + d·h + K·(h − T·(1 − e^(−h/T)))·u  =  x_r(h) − (x_r − x)·e^(−3h/t_r)
"""

from __future__ import annotations

import math
from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, model_parameters, model_values, number
from hydraulic_control.law_parts import end_observer


def begin(p: Any, s: Any, position: float) -> None:
    """The model at rest where the piston is."""
    s.model_position = position


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The drive [V] that brings the prediction to the reference trajectory at the coincidence point."""
    decayed = p.lag * (1.0 - math.exp(-p.horizon / p.lag))
    goal = (
        reference
        + reference_velocity * p.horizon
        - (reference - position) * math.exp(-3.0 * p.horizon / p.response_time)
    )
    free = position + s.model_velocity * decayed + s.drift * p.horizon
    return (goal - free) / (p.velocity_gain * (p.horizon - decayed))


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several response times."""
    model = model_values("pfc", simple)
    return [{**model, "pfc.response_time": t, "pfc.horizon": 0.3 * t} for t in (0.08, 0.15, 0.3)]


LAW = Law(
    description="predictive functional control on an integrating model",
    source="Richalet & O'Donovan 2009; Izzuddin 2015, Richalet 2011",
    begin=begin,
    drive=drive,
    end=end_observer,
    parameters=(
        *model_parameters("pfc"),
        number("pfc.response_time", 0.15, "closed-loop response time, to 95 %", "s", 1e-2, 10.0),
        number("pfc.horizon", 0.05, "coincidence point", "s", 5e-3, 1.0),
        number("pfc.observer", 30.0, "poles of the observer of position and drift", "rad/s", 0.1, 300.0),
    ),
    state=(("model_position", ()), ("model_velocity", ()), ("drift", ())),
    tuned=("pfc.response_time", "pfc.horizon", "pfc.observer"),
    starts=starts,
    needs="identified model",
    claims=(Claim("follows better than PID tuned by a swarm (Izzuddin 2015)", "sine", "rms_error", over="pid"),),
)
