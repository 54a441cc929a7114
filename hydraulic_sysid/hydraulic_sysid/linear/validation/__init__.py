"""Validation of identified models: residual tests, and errors over drives that were not fitted."""

from .residuals import residual_tests
from .rmse_grid import SHAPES, Grid, periodic, records_rmse, rmse_grid

__all__ = ["SHAPES", "Grid", "periodic", "records_rmse", "residual_tests", "rmse_grid"]
