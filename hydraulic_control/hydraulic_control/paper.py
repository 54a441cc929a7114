"""The figures of the paper that this project makes real, for the tables in which ours stand beside them.

Z. Nisar, H. Munawar, System Identification and Controller Design for Hydraulic Actuator, table Transient response
analysis. The paper names neither the amplitude of its step nor its gains.
"""

from __future__ import annotations

from typing import NamedTuple


class PaperStep(NamedTuple):
    """Rise time [s], settling time [s] and overshoot [%] of a step with NPID."""

    rise_time: float
    settling_time: float
    overshoot: float


STEPS: dict[str, tuple[PaperStep, PaperStep]] = {
    "chirp": (PaperStep(0.25, 2.1, 4.5), PaperStep(0.28, 2.2, 4.8)),
    "multisine": (PaperStep(0.10, 2.8, 3.2), PaperStep(0.30, 3.0, 4.3)),
}
"""By the excitation of the identified model: on that model, and on the nonlinear one."""


def beside(name: str) -> tuple[PaperStep, PaperStep] | None:
    """The paper's figures for an identified model of that name ("demo-chirp"), None where it has none."""
    return next((figures for key, figures in STEPS.items() if key in name.lower()), None)
