"""The largest amplitude of a plan within the limits of the bench, found on a model."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from hydraulic_sim.errors import SimulationError
from hydraulic_sim.linear import operating_point
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.excitation.errors import ExcitationError, PlanError
from hydraulic_sysid.excitation.plan import Plan, Prediction
from hydraulic_sysid.excitation.simulated_run import SimulatedRun, simulate_plan

_TRAVEL_SHARE = 0.8
_DRIVE_SHARE = 0.95
_SPEED_SHARE = 0.9
_CAVITATION_PA = 0.2e6
_STEPS = 12
_TOO_MUCH = 2.0
_TOLERANCE = 0.01


@dataclass(frozen=True)
class Limits:
    """What an excitation may ask for: drive [V], travel from the plan's centre [m], speed [m/s], pressures [Pa]."""

    drive: float
    travel: float
    velocity: float
    pressure_min: float
    pressure_max: float

    @classmethod
    def of(cls, model: Model, centre: float = 0.0) -> Limits:
        """Those of a model.

        95 % of the drive, 80 % of the way from the centre to the nearer stop, 90 % of the speed at full drive, at least
        0.2 MPa above absolute vacuum in both chambers (below, air comes out of the oil), at most the supply pressure
        and a quarter.
        """
        drive = model.value("drive_limit")
        hydraulic = model.kind == "hydraulic"
        speed = abs(operating_point(model, drive=drive).velocity) if hydraulic else float("inf")
        return cls(
            drive=_DRIVE_SHARE * drive,
            travel=_TRAVEL_SHARE * (0.5 * model.value("stroke") - abs(centre)),
            velocity=_SPEED_SHARE * speed,
            pressure_min=_CAVITATION_PA if hydraulic else -float("inf"),
            pressure_max=1.25 * model.value("supply_pressure") if hydraulic else float("inf"),
        )

    def used(self, seen: SimulatedRun, centre: float) -> dict[str, float]:
        """Which part of each limit a simulated run uses; above 1 it breaks the limit.

        Of the pressures it is the part of the way from where they begin.
        """
        extremes, start = seen.extremes, float(seen.record["pressure_a"][0])
        parts = {
            "travel": max(extremes.position_max - centre, centre - extremes.position_min) / self.travel,
            "drive": extremes.drive_peak / self.drive,
            "velocity": extremes.velocity_peak / self.velocity,
        }
        if self.pressure_min < start:
            parts["cavitation"] = (start - extremes.pressure_min) / (start - self.pressure_min)
        if start < self.pressure_max:
            parts["pressure"] = (extremes.pressure_max - start) / (self.pressure_max - start)
        return parts


@dataclass(frozen=True)
class Sized:
    """A plan with its prediction, and the simulated run behind it."""

    plan: Plan
    simulated: SimulatedRun


def largest(plan: Plan, model: Model, limits: Limits | None = None, share: float = 1.0, cap: float = math.inf) -> Sized:
    """`plan` with the largest amplitude at which its simulated run on `model` breaks no limit, times `share`.

    Found by bisection to 1 %; at most `cap` times what the plan has. The plan's travel and amplitude limits become
    those of `limits`, so that the run on the bench aborts where the prediction promised that it would not go.

    :raises ExcitationError: no amplitude down to a thousandth of the drive keeps the limits; says which one breaks.
    """
    limits = limits or Limits.of(model, plan.centre)
    plant = Plant(model)
    room = limits.drive - abs(plan.offset)
    peak = _peak(plan)
    if room <= 0.0 or peak <= 0.0:
        raise ExcitationError(f"{plan.name}: an offset of {plan.offset:g} V leaves no drive below {limits.drive:g} V")
    low, high = 0.0, min(room / peak, cap)
    limit = "drive" if room / peak <= cap else "amplitude given"
    best: Sized | None = None
    factor = high
    for step in range(_STEPS):
        seen, part, why = _try(plan, plant, limits, factor)
        if part <= 1.0:
            best, low = seen, factor
            if part >= 1.0 - _TOLERANCE or factor >= high:
                break
        else:
            high, limit = factor, why
        if high - low < _TOLERANCE * low or high * peak < 1e-3 * limits.drive:
            break
        # What is used of a limit grows about as the amplitude; the bracket holds where it does not.
        factor = factor * (1.0 - 0.5 * _TOLERANCE) / part
        if not low < factor < high:
            factor = 0.5 * (low + high)
        if best is None and step > 0:
            factor = min(factor, 0.6 * high)  # a pressure that lies at its least already does not show by how much
    if best is None:
        raise ExcitationError(
            f"{plan.name}: no amplitude down to {factor * peak:.3g} V keeps within the limits; {limit} breaks first: "
            "take a higher lowest frequency or wider limits"
        )
    if share < 1.0:
        best, part, why = _try(plan, plant, limits, share * low)
        limit = f"{share:.0%} of what {limit} allows"
        if part > 1.0:
            raise ExcitationError(f"{plan.name}: at {share:.0%} of the largest amplitude {why} breaks")
    assert best is not None
    prediction: Prediction = replace(best.simulated.extremes, limited_by=limit)
    return Sized(replace(best.plan, prediction=prediction), best.simulated)


def _try(plan: Plan, plant: Plant, limits: Limits, factor: float) -> tuple[Sized | None, float, str]:
    """The plan `factor` times as large and simulated; the largest part it uses of a limit, and of which."""
    try:
        signal = plan.signal.scaled(factor)
        # The run stops a little beyond the limit that the simulated run keeps: sensors are noisy.
        bounded = replace(plan, signal=signal, amplitude_limit=limits.drive, travel_limit=1.1 * limits.travel)
    except PlanError:
        return None, _TOO_MUCH, "drive"
    try:
        simulated = simulate_plan(bounded, plant)
    except SimulationError:
        return None, _TOO_MUCH, "the model, which no step follows there,"
    parts = limits.used(simulated, plan.centre)
    why = max(parts, key=lambda name: parts[name])
    # What was broken off has not shown how far it would have gone.
    part = max(parts[why], _TOO_MUCH) if simulated.aborted else parts[why]
    return Sized(bounded, simulated), part, why


def _peak(plan: Plan) -> float:
    drive = plan.open_loop - plan.envelope * plan.offset
    return float(max(abs(drive.max()), abs(drive.min())))
