"""Figures of an effect that was added: those of a diagnosis."""

from hydraulic_sysid.report.diagnose.figures import segment, steps

__all__ = ["segment", "steps"]
