"""Estimation while the bench runs: slower sampling of a stream, a running fit, the model beside the plant."""

from .live_model import LiveModel
from .recent_rms import RecentRms
from .running_arx import RunningArx, RunningFit, SlowSampler

__all__ = ["LiveModel", "RecentRms", "RunningArx", "RunningFit", "SlowSampler"]
