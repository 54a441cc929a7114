"""Active disturbance rejection: an extended state observer takes all that the model lacks for one disturbance.

Z. Gao, Scaling and bandwidth-parameterization based controller tuning, American Control Conference 2003; J. Han, From
PID to active disturbance rejection control, IEEE Trans. Ind. Electron. 56 (2009). The model is ẍ = (K·u − ẋ)/T + f.
"""

from __future__ import annotations

from typing import Any

from hydraulic_control.law import Claim, Law, SimpleModel, Values, model_parameters, model_values, number


def begin(p: Any, s: Any, position: float) -> None:
    """The observer at rest where the piston is."""
    s.z1 = position


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The law: u = T/K·(ω²·(x_r − z₁) + 2ω·(v_r − z₂) + z₂/T − z₃)."""
    w = p.bandwidth
    wanted = w * w * (reference - s.z1) + 2.0 * w * (reference_velocity - s.z2)
    return p.lag / p.velocity_gain * (wanted + s.z2 / p.lag - s.z3)


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Advance the observer, its poles at −ω_o, with the drive that is had."""
    w, apart = p.observer, s.position - s.z1
    s.z1 += dt * (s.z2 + 3.0 * w * apart)
    s.z2 += dt / (1.0 + dt / p.lag) * (s.z3 + (p.velocity_gain * s.drive - s.z2) / p.lag + 3.0 * w * w * apart)
    s.z3 += dt * w * w * w * apart


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """Several bandwidths."""
    model = model_values("adrc", simple)
    return [{**model, "adrc.bandwidth": w, "adrc.observer": 4.0 * w} for w in (10.0, 20.0, 40.0)]


LAW = Law(
    description="active disturbance rejection (ADRC), second order",
    source="Gao 2003; Han 2009",
    begin=begin,
    drive=drive,
    end=end,
    parameters=(
        *model_parameters("adrc"),
        number("adrc.bandwidth", 20.0, "of the closed loop", "rad/s", 0.1, 300.0),
        number("adrc.observer", 80.0, "of the extended state observer", "rad/s", 0.1, 600.0),
    ),
    state=(("z1", ()), ("z2", ()), ("z3", ())),
    tuned=("adrc.bandwidth", "adrc.observer"),
    starts=starts,
    needs="identified model",
    claims=(Claim("rejects disturbances better than PID (Han 2009)", "load_step", "iae", over="pid"),),
)
