"""A nonlinear model beside measurements: predictions, errors, where they sit, and what that says in words."""

from .comparison import compare
from .prediction import ComparisonError

__all__ = ["ComparisonError", "compare"]
