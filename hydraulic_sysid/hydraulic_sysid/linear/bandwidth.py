"""Bandwidth of a model file or of a probe's record, as a result document."""

from __future__ import annotations

from typing import Any

import numpy as np

from hydraulic_sim.linear import linearise
from hydraulic_sim.model import Model
from hydraulic_sim.plant import Plant
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.data.results import heading
from hydraulic_sysid.excitation import Plan
from hydraulic_sysid.excitation.bandwidth import GAIN_SHARE, Bandwidth, BandwidthError, from_response
from hydraulic_sysid.linear.frequency_response import best_linear_approximation, periods_of

_DEVIATION = 0.25  # of the response, above which a line is not used
_FEWEST = 20
_LOWEST_HZ, _HIGHEST_HZ, _POINTS = 1e-3, 1e3, 12001


def from_model(model: Model, position: float = 0.0) -> Bandwidth:
    """Of the model linearised around rest at `position` [m]; dry friction has no linear part.

    :raises SimulationError: no steady state there.
    :raises BandwidthError: outside 1 mHz … 1 kHz.
    """
    frequency = np.geomspace(_LOWEST_HZ, _HIGHEST_HZ, _POINTS).astype(np.float64)
    system = linearise(model, position)
    response = np.asarray(system(2j * np.pi * frequency)).reshape(-1, frequency.size)[0]
    return from_response(frequency, response)


def from_rehearsal(model: Model, plan: Plan) -> tuple[Bandwidth, np.ndarray]:
    """Of the model under a probe's plan, with friction and the damping that an open valve has.

    :raises BandwidthError: as `from_record`, or the plan leaves its travel.
    """
    from hydraulic_sysid.excitation.rehearsal import rehearse

    played = rehearse(plan, Plant(model))
    if played.aborted:
        raise BandwidthError(f"{plan.name} on {model.name}: {played.aborted}")
    return from_record(played.record)


def from_record(record: Record, period: float | None = None, start: float = 0.0) -> tuple[Bandwidth, np.ndarray]:
    """Of the record of a periodic excitation, and the coherence (K,) of the lines used.

    Lines are used whose response has a standard deviation of at most a quarter of it.

    :raises FrequencyResponseError: no whole periods in the record.
    :raises BandwidthError: too few lines stand out of the noise, or they do not reach the bandwidth.
    """
    response = best_linear_approximation([periods_of(record, period=period, start=start)])
    good = response.noise <= _DEVIATION * np.abs(response.response)
    if np.count_nonzero(good) < _FEWEST:
        raise BandwidthError(
            f"{record.name}: only {np.count_nonzero(good)} of {good.size} lines stand out of the noise (needed: "
            f"{_FEWEST}); excite more strongly or longer"
        )
    return from_response(response.frequency[good], response.response[good]), response.coherence[good]


def document(found: Bandwidth, source: dict[str, Any], coherence: np.ndarray | None = None) -> dict[str, Any]:
    """The result document; ``source`` says what it was taken from (``kind``, ``name``, ``path``)."""
    low, high = found.band()
    reach = f"to {found.velocity:.3g} Hz" if np.isfinite(found.velocity) else f"beyond {found.frequency[-1]:.3g} Hz"
    text = (
        f"Position bandwidth {found.position:.3g} Hz: excite from {low:.2g} to {high:.3g} Hz (0.1 … 2 times). "
        f"The velocity follows {reach}."
    )
    return {
        **heading("bandwidth", 2),
        "verdict": {"level": "explained", "text": text},
        "title": f"Bandwidth of {source['name']}",
        "model": {"name": source["name"]},
        "source": source,
        "position_bandwidth": found.position,
        "velocity_bandwidth": found.velocity,
        "velocity_gain": found.velocity_gain,
        "critical_gain": found.critical_gain,
        "gain_share": GAIN_SHARE,
        "phase_crossover": found.phase_crossover,
        "excitation_band": [low, high],
        "frequency": found.frequency,
        "response": {"real": found.response.real, "imaginary": found.response.imag},
        "closed_loop": {"magnitude": np.abs(found.closed_loop), "phase": np.unwrap(np.angle(found.closed_loop))},
        "coherence": coherence,
    }
