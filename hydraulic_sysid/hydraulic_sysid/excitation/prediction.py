"""What a model does under a plan: a section of the plan's file, written before anything moves."""

from __future__ import annotations

from dataclasses import dataclass

from hydraulic_sysid.excitation.declared import Declared, number, text


@dataclass(frozen=True)
class Prediction(Declared):
    """The extremes of the plan simulated on a model, and what kept its amplitude from being larger."""

    label = "prediction"

    model: str = text("the model it was simulated on")
    drive_peak: float = number("V", "largest drive, centring included", minimum=0.0, maximum=1e3)
    position_min: float = number("m", "least position", minimum=-1e3, maximum=1e3)
    position_max: float = number("m", "greatest position", minimum=-1e3, maximum=1e3)
    velocity_peak: float = number("m/s", "greatest speed", minimum=0.0, maximum=1e3)
    pressure_min: float = number("Pa", "least pressure of both chambers", minimum=-1e9, maximum=1e9)
    pressure_max: float = number("Pa", "greatest pressure of both chambers", minimum=-1e9, maximum=1e9)
    limited_by: str = text("what allows no larger amplitude", "")
