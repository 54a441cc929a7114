"""Base of the errors that this package raises for what a user handed in."""

from __future__ import annotations


class HydraulicControlError(ValueError):
    """Input is not acceptable; the message says where, what was found and what is allowed."""
