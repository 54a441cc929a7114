"""Estimation while the bench runs: slower sampling of a stream, a running fit, the model beside the plant."""

from .live_model import LiveModel
from .running_arx import RunningArx, RunningFit, SlowSampler

__all__ = ["LiveModel", "RunningArx", "RunningFit", "SlowSampler"]
