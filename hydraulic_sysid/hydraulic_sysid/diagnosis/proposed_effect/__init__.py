"""A user effect for what no effect of the library explains, proposed from the curve that the remainder shows."""

from .proposal import ProposedEffect, propose

__all__ = ["ProposedEffect", "propose"]
