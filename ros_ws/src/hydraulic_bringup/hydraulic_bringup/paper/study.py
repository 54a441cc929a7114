"""What is played and what is made of it: the paper's two excitations, in its band and on both sides of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hydraulic_sim.model import Model
from hydraulic_sysid.data.records import Record
from hydraulic_sysid.excitation import Plan, Signal
from hydraulic_sysid.excitation.amplitude import largest
from hydraulic_sysid.excitation.design import Wish, propose
from hydraulic_sysid.excitation.signals.sawtooth import Sawtooth
from hydraulic_sysid.excitation.signals.sine import Sine
from hydraulic_sysid.excitation.signals.square import Square
from hydraulic_sysid.excitation.signals.triangle import Triangle
from hydraulic_sysid.linear.identification import IdentificationSettings, identify
from hydraulic_sysid.linear.models import LinearModel, TransferFunctionOrder
from hydraulic_sysid.linear.models.structures import Arx, TransferFunction
from hydraulic_sysid.linear.validation import Grid

BANDS = {"in": (0.1, 2.0), "below": (0.01, 0.1), "above": (2.0, 20.0)}
"""Parts of the bandwidth: the paper's band, and a decade on either side of it."""
KINDS = {"chirp": "chirp", "multisine": "three_tones"}
"""The paper's excitations and the designs that make them."""
IDENTIFICATION = {
    "chirp": IdentificationSettings(structure=Arx(), sampling_time=0.05, holdout=0.2),
    "multisine": IdentificationSettings(
        structure=TransferFunction(TransferFunctionOrder(3, 0)), sampling_time=0.01, holdout=0.5
    ),
}
"""ARX(3, 3, 1) every 50 ms on the first 80 %; third-order transfer function on the first half."""
DURATION_S, SHORT_S = 50.0, 8.0
SHORT_APPROACH_S = 5.0
AMPLITUDES_V = (2.5, 5.0)
FREQUENCIES = (0.2, 0.5, 1.0, 2.0)  # of the bandwidth
RECORDED_V, RECORDED_FREQUENCY = 5.0, 0.5


@dataclass(frozen=True)
class Excitation:
    """One excitation of the study: its kind, its band, and the plan with its prediction."""

    kind: str
    band: str
    plan: Plan

    @property
    def name(self) -> str:
        """Of its record: ``chirp`` in the paper's band, ``chirp_above`` beside it."""
        return self.kind if self.band == "in" else f"{self.kind}_{self.band}"


@dataclass(frozen=True)
class Identified:
    """A model with its result document, and the part of its record that the fit has not seen."""

    excitation: Excitation
    document: dict[str, Any]
    model: LinearModel
    test_record: Record


def excitations(
    model: Model,
    bandwidth: float,
    duration: float,
    tick: Callable[[], None] = lambda: None,
    bands: Sequence[str] = tuple(BANDS),
) -> list[Excitation]:
    """Both kinds in each band, as large as the limits allow on `model`; the paper's band first.

    :raises ExcitationError: a band that does not fit the duration.
    """
    found = []
    for band in bands:
        low, high = BANDS[band]
        for kind, design in KINDS.items():
            plan = propose(design, Wish(low * bandwidth, high * bandwidth, duration))
            sized = largest(plan, model).plan
            name = Excitation(kind, band, sized).name
            found.append(Excitation(kind, band, replace(sized, name=name)))
            tick()
    return found


def played(plan: Plan, record: Record) -> Record:
    """The signal's part of a record, without the rests around it."""
    return record.window(plan.signal_start, plan.signal_start + plan.active_time)


def identified(excitation: Excitation, record: Record) -> Identified:
    """The paper's model of that kind of excitation.

    :raises IdentificationError: the record does not give the model.
    """
    settings = IDENTIFICATION[excitation.kind]
    part = played(excitation.plan, record)
    document, model = identify([part], None, settings)
    return Identified(excitation, document, model, part.split(1.0 - settings.holdout)[1])


def grid(bandwidth: float) -> Grid:
    """The validation signals: the paper's four shapes, of two amplitudes and four frequencies."""
    return Grid(AMPLITUDES_V, tuple(f * bandwidth for f in FREQUENCIES))


def recorded_shapes(model: Model, bandwidth: float, duration: float) -> list[Plan]:
    """Plans of the paper's four shapes at one amplitude and frequency, to be recorded on the bench.

    :raises ExcitationError: they do not keep within the limits.
    """
    frequency = RECORDED_FREQUENCY * bandwidth
    waves: dict[str, Signal] = {
        "triangle": Triangle(RECORDED_V, frequency),
        "square": Square(RECORDED_V, frequency, 0.25),
        "sine": Sine(RECORDED_V, frequency, 0.5 * math.pi),
        "sawtooth": Sawtooth(RECORDED_V, frequency),
    }
    common = propose("sine", Wish(BANDS["in"][0] * bandwidth, BANDS["in"][1] * bandwidth, duration))
    plans = []
    for shape, wave in waves.items():
        plan = replace(common, name=f"validation_{shape}", description=f"{shape} for validation", signal=wave)
        plans.append(largest(plan, model, cap=1.0).plan)
    return plans
