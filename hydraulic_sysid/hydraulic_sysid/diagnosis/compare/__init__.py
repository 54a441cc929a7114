"""A nonlinear model beside measurements: predictions, errors, where they sit, and what that says in words."""

from .comparison import compare
from .prediction import ComparisonError
from .subject import ModelSubject

__all__ = ["ComparisonError", "ModelSubject", "compare"]
