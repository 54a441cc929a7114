"""Estimation while the bench runs: slower sampling of a stream, a running fit, the model beside the plant."""

from .live_model import LiveModel
from .running_arx import RunningArx
from .running_fit import RunningFit
from .slow_sampler import SlowSample, SlowSampler

__all__ = ["LiveModel", "RunningArx", "RunningFit", "SlowSample", "SlowSampler"]
