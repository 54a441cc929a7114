"""Excitation: signals, the plan of an experiment, and the run that plays it."""

from hydraulic_sysid.excitation.applied import AppliedDriveCheck
from hydraulic_sysid.excitation.errors import ExcitationError, PlanError, PlaybackError
from hydraulic_sysid.excitation.plan import Plan, load_plan, save_plan, shipped_plans
from hydraulic_sysid.excitation.run import ExcitationRun, Phase
from hydraulic_sysid.excitation.session import NOT_STARTED, Session
from hydraulic_sysid.excitation.signals import Signal, signal_kinds

__all__ = [
    "NOT_STARTED",
    "AppliedDriveCheck",
    "ExcitationError",
    "ExcitationRun",
    "Phase",
    "Plan",
    "PlanError",
    "PlaybackError",
    "Session",
    "Signal",
    "load_plan",
    "save_plan",
    "shipped_plans",
    "signal_kinds",
]
