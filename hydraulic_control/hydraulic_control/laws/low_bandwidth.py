"""A slow, robust loop designed on an identified fourth-order model: well below its resonance, with a roll-off.

G. Ren, J. Song, N. Sepehri 2018: the linear model K·ω²/(s·(Ts + 1)·(s² + 2ζωs + ω²)) comes from a chirp; what it does
not know lies above the bandwidth ω_c of the loop

    u = k·(F·e + ω_c/r·∫e dt),   F = 1/(1 + s/(ρ·ω_c))²,   |k·F·G| = 1 at ω_c,   |k·F·G| ≤ 1/2 at ω
"""

from __future__ import annotations

import math
from typing import Any

from hydraulic_control.errors import ControlError
from hydraulic_control.law import Claim, Law, SimpleModel, Values, fed_forward, model_parameters, model_values, number
from hydraulic_control.law_parts import integrate

_MOST = 0.5  # of the loop's gain at the resonance: 6 dB


def derived(values: Values) -> dict[str, float]:
    """Gain k [V/m] and that of the integral [V/(m·s)]."""
    own = {name.removeprefix("low_bandwidth."): values[name] for name in values if name.startswith("low_bandwidth.")}
    crossing, resonance = own["bandwidth"], own["frequency"]

    def loop(omega: float) -> float:
        s, w = 1j * omega, resonance
        plant = (
            own["velocity_gain"] / (s * (own["lag"] * s + 1.0)) * w * w / (s * s + 2.0 * own["damping"] * w * s + w * w)
        )
        return abs(plant / (1.0 + s / (own["rolloff"] * crossing)) ** 2)

    gain = 1.0 / loop(crossing)
    if not (crossing < resonance and gain * loop(resonance) <= _MOST):
        raise ControlError(
            f"low_bandwidth.bandwidth is {crossing:g} rad/s: at the resonance of {resonance:g} rad/s the loop would "
            f"have a gain of {gain * loop(resonance):.2g}; choose one, or a roll-off, that leaves {_MOST:g} at most"
        )
    return {"gain": gain, "slow_gain": gain * crossing / own["integral_ratio"]}


def drive(p: Any, s: Any, dt: float, reference: float, reference_velocity: float, position: float) -> float:
    """The filtered error and its integral."""
    share = dt * p.rolloff * p.bandwidth / (1.0 + dt * p.rolloff * p.bandwidth)
    s.first += share * (reference - position - s.first)
    s.second += share * (s.first - s.second)
    return p.gain * s.second + p.slow_gain * s.integral


def end(p: Any, s: Any, dt: float, e: float, wanted: float) -> None:
    """Integrate."""
    integrate(p, s, dt, e, p.slow_gain, wanted)


def starts(simple: SimpleModel, gains: list[Values]) -> list[dict[str, Any]]:
    """A tenth of the resonance, and less; the velocity of the reference is fed forward."""
    model = {
        **model_values("low_bandwidth", simple),
        "low_bandwidth.frequency": simple.frequency,
        "low_bandwidth.damping": simple.damping,
    }
    bandwidths = (part * simple.frequency for part in (0.02, 0.05, 0.1))
    return fed_forward(simple, ({**model, "low_bandwidth.bandwidth": w} for w in bandwidths))


LAW = Law(
    description="low-bandwidth loop on a fourth-order model",
    source="Ren 2018",
    drive=drive,
    end=end,
    parameters=(
        *model_parameters("low_bandwidth"),
        number("low_bandwidth.frequency", 245.0, "ω of the model's resonance", "rad/s", 1.0, 1e4),
        number("low_bandwidth.damping", 0.1, "ζ of the model's resonance", "1", 1e-3, 2.0),
        number("low_bandwidth.bandwidth", 10.0, "ω_c, where the loop's gain is 1", "rad/s", 0.1, 500.0),
        number("low_bandwidth.integral_ratio", 10.0, "r: the integral takes over at ω_c/r", "1", 2.0, 1e3),
        number("low_bandwidth.rolloff", 4.0, "ρ: the loop rolls off at ρ·ω_c", "1", 1.0, 100.0),
    ),
    state=(("first", ()), ("second", ())),
    derived=(("gain", ()), ("slow_gain", ())),
    design=derived,
    tuned=("low_bandwidth.bandwidth", "low_bandwidth.integral_ratio", "low_bandwidth.rolloff"),
    starts=starts,
    needs="identified model of fourth order",
    claims=(
        Claim(
            "internal leakage slows the loop (Ren 2018)",
            "leakage",
            "rise_time",
            over_trial="step",
            low=1.02,
            high=math.inf,
        ),
    ),
)
