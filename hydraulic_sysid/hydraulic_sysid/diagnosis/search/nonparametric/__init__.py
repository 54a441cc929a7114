"""Unknown additions of any shape, one file per place in the plant where something may be missing.

Each is an effect like those of the library, so that the plant takes it as one: it adds a hat function of some height at
one place of one variable. Side by side, hat functions make a curve without a law behind it (linear B-splines); its
coefficients, fitted to a residual, show what the library lacks.
"""

from __future__ import annotations

from pathlib import Path

FILES = tuple(sorted(Path(__file__).parent.glob("unknown_*.py")))
WITH_MEMORY = tuple(sorted(Path(__file__).parent.glob("with_memory/unknown_*.py")))
"""Those over a variable as it was: for a law that is proposed, not for a verdict."""
